#include "clients/haptic/smooth_reach.h"

namespace tenon {

namespace {
constexpr double kGain = 4.0;        // [1/s] speed for the way left
constexpr double kSmoothing = 0.06;  // [s] of each of the two stages

Vector3 capped(const Vector3& v, double limit) {
  const double length = v.norm();
  return length > limit ? Vector3(v * (limit / length)) : v;
}
}  // namespace

void SmoothReach::start(const Pose& X_WH) noexcept {
  X_WH_ = X_WH;
  velocity_ = {};
  push_ = {};
}

void SmoothReach::step(const Pose& X_WG, double max_speed, double max_turn_speed, double dt) noexcept {
  const Displacement way = displacement(X_WH_, X_WG);
  const double blend = dt / kSmoothing;
  push_.linear += blend * (capped(kGain * way.translation, max_speed) - push_.linear);
  push_.angular += blend * (capped(kGain * way.rotation, max_turn_speed) - push_.angular);
  velocity_.linear += blend * (push_.linear - velocity_.linear);
  velocity_.angular += blend * (push_.angular - velocity_.angular);
  X_WH_ = displaced(X_WH_, {dt * velocity_.linear, dt * velocity_.angular});
}

void SmoothReach::stayWithin(const Vector3& p_WC, double reach) noexcept {
  const Vector3 p_CH = X_WH_.translation() - p_WC;
  if (const double distance = p_CH.norm(); distance > reach) {
    X_WH_.translation() = p_WC + p_CH * (reach / distance);
  }
}

}  // namespace tenon
