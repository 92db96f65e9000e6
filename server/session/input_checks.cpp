#include "server/session/input_checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "idl/types/resolution.h"

namespace tenon::session {
namespace {

constexpr double kMaxPosition = 1000.0;     // [m] of an object from the world's origin, each axis
constexpr double kMaxHandPosition = 127.0;  // [m] of a hand, likewise: what its messages reach
constexpr double kMaxSpeed = 50.0;          // [m/s], [rad/s] of a hand
constexpr double kMinStiffness = 1.0, kMaxStiffness = 1e4;  // [N/m] of what a device may ask for
constexpr double kMinRotationalStiffness = 0.1, kMaxRotationalStiffness = 1e3;  // [Nm/rad] likewise

bool isPlausible(const Pose& X, double most) {
  return X.isFinite() && X.translation().cwiseAbs().maxCoeff() < most &&
         std::abs(X.rotation().squaredNorm() - 1.0) < 1e-3;
}

/// 0: not stated. What is stated is bounded as in a scenario, since it conditions the solver.
bool isPlausible(double stiffness, double least, double most) {
  return stiffness == 0.0 || (stiffness >= least && stiffness <= most);
}

bool isPlausible(const Vector3& v, double limit) { return v.allFinite() && v.norm() < limit; }

}  // namespace

Result<HandReading> checkedReading(const DeviceInput& input, const std::string& hand) {
  const DeviceSample& newest = input.sample;
  if (!isPlausible(newest.X_WH, kMaxHandPosition) || !isPlausible(newest.V_WH.linear, kMaxSpeed) ||
      !isPlausible(newest.V_WH.angular, kMaxSpeed))
    return fail(fmt::format("client {} sent an implausible pose or velocity of hand '{}': ignored",
                            input.client.value, hand));
  if (input.period < 1 || input.period > kMostInputPeriod)
    return fail(fmt::format("client {} sent an input of hand '{}' with a period of {} ms: expected 1 to {}",
                            input.client.value, hand, input.period, kMostInputPeriod));
  // as over the wire, so that a rehearsal without one has the same bits
  return HandReading{input.hand,           newest.seq,           input.active,
                     rounded(newest.X_WH), rounded(newest.V_WH), newest.buttons};
}

std::string stiffnessRefusal(const std::vector<HandStiffness>& stiffness) {
  const auto isOut = [](const HandStiffness& hand) {
    return !isPlausible(hand.translational, kMinStiffness, kMaxStiffness) ||
           !isPlausible(hand.rotational, kMinRotationalStiffness, kMaxRotationalStiffness);
  };
  if (std::none_of(stiffness.begin(), stiffness.end(), isOut)) return {};
  return fmt::format("the stiffness of a hand is out of range: expected {} to {} N/m and {} to {} Nm/rad",
                     kMinStiffness, kMaxStiffness, kMinRotationalStiffness, kMaxRotationalStiffness);
}

Result<Change> checkedForce(const ForceContribution& force, const game_control::ScenarioFile& scenario) {
  if (force.object.value >= scenario.objects.size())
    return fail(fmt::format("client {} sent a force for an unknown object", force.client.value));
  if (!force.F_Oo_W.force.allFinite() || !force.F_Oo_W.torque.allFinite())
    return fail(fmt::format("client {} sent a force that is not finite", force.client.value));
  return Change{.kind = ChangeKind::kContributeForce,
                .object = force.object,
                .index = force.source,
                .lifetime_ticks = force.lifetime_ticks,
                .F_Oo_W = force.F_Oo_W};
}

Result<Change> checkedPose(const ExternalPose& pose, const game_control::ScenarioFile& scenario) {
  if (pose.object.value >= scenario.objects.size() || !isPlausible(pose.X_WO, kMaxPosition))
    return fail(
        fmt::format("client {} sent an implausible pose or one of an unknown object", pose.client.value));
  return Change{.kind = ChangeKind::kPlaceObject,
                .object = pose.object,
                .lifetime_ticks = pose.lifetime_ticks,
                .X_WO = pose.X_WO};
}

}  // namespace tenon::session
