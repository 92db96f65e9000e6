#include "clients/haptic/predicted_body.h"

#include <algorithm>

namespace tenon::haptic {

namespace {
// Rounding, and what a body that is about to sleep has left.
constexpr double kSmallestWay = 5e-5;   // [m] of any point
constexpr double kSmallestPace = 2e-3;  // [m/s] likewise

Displacement sum(const Displacement& a, const Displacement& b, double factor) {
  return {a.translation + factor * b.translation, a.rotation + factor * b.rotation};
}
Twist sum(const Twist& a, const Twist& b, double factor) {
  return {a.linear + factor * b.linear, a.angular + factor * b.angular};
}
}  // namespace

void PredictedBody::restart() noexcept {
  past_.fill({});
  moved_ = to_move_ = {};
  changed_ = to_change_ = {};
}

void PredictedBody::compare(const ObservedObject& seen, std::uint32_t seq) noexcept {
  const Past& then = past_[seq % past_.size()];
  if (then.seq != seq || seq == 0) return;
  const Displacement apart = displacement(then.X_WO, seen.X_WO, seen.p_OQ_O);
  to_move_ = sum(apart, sum(moved_, then.moved, -1.0), -1.0);
  to_change_ = sum(sum(seen.V_WO, then.V_WO, -1.0), sum(changed_, then.changed, -1.0), -1.0);
}

bool PredictedBody::correct(const ObservedObject& seen, Pose& X_WO, Twist& V_WO) noexcept {
  const double way = maxPointMotion(to_move_, seen.radius);
  const double pace = to_change_.linear.norm() + to_change_.angular.norm() * seen.radius;
  if (way < kSmallestWay && pace < kSmallestPace) return false;
  constexpr double kShare = kTickSeconds / kSettle;
  const double share = way * kShare > kLargestStep ? kLargestStep / way : kShare;
  const Displacement step = sum({}, to_move_, share);
  const Twist change = sum({}, to_change_, kShare);
  X_WO = displaced(X_WO, step, seen.p_OQ_O);
  V_WO = sum(V_WO, change, 1.0);
  moved_ = sum(moved_, step, 1.0);
  changed_ = sum(changed_, change, 1.0);
  to_move_ = sum(to_move_, step, -1.0);
  to_change_ = sum(to_change_, change, -1.0);
  return true;
}

}  // namespace tenon::haptic
