#include "devices/safety_rules.h"

#include <algorithm>
#include <cmath>

namespace tenon::devices {
namespace {

constexpr double kWallRadiusFraction = 0.95;  ///< [-] of the workspace radius
constexpr double kSmallForce = 0.01;          ///< [N] a scene's force below it is rounding
constexpr double kStorageTravel = 0.02;       ///< [m] energy capacity = peak force along this displacement
constexpr double kActiveSpeed = 0.01;         ///< [m/s] active power = peak force at this speed
constexpr double kDeratingStart = 0.8;        ///< [-] motor heat above which the force limit falls
/// [m] from the wrist to the grip: a force of the soft start there is a torque of the wrist.
constexpr double kWristLever = 0.1;
constexpr double kDeficitTravel = 1e-3;  ///< [m] deficit of the whole damping = peak force along it

/// K <= b / (T/2 + delay): Colgate's passivity condition with a transport delay. `limit` caps the result.
double maxPassiveStiffness(double limit, double damping, const DeviceCaps& caps) {
  if (limit <= 0.0 || caps.rate <= 0.0) return 0.0;
  return std::min(limit, damping / (0.5 / caps.rate + caps.delay));
}

}  // namespace

const char* toString(SafetyRule rule) noexcept {
  switch (rule) {
    case SafetyRule::kNonFinite:
      return "non-finite force request";
    case SafetyRule::kAgeFading:
      return "force fading by age";
    case SafetyRule::kStale:
      return "force request timed out";
    case SafetyRule::kStiffnessLimited:
      return "stiffness limited";
    case SafetyRule::kSoftStart:
      return "soft start";
    case SafetyRule::kSlewLimited:
      return "force ramp limited";
    case SafetyRule::kPassivity:
      return "passivity damping";
    case SafetyRule::kWorkspaceWall:
      return "workspace limit";
    case SafetyRule::kForceLimited:
      return "force limited";
    case SafetyRule::kThermal:
      return "thermal limit";
    case SafetyRule::kMotorSaturated:
      return "motor command saturated";
    case SafetyRule::kOverspeed:
      return "overspeed, braking";
    case SafetyRule::kClutchWarning:
      return "force near the clutch limit";
    case SafetyRule::kClutchOpen:
      return "clutch open";
    case SafetyRule::kDeadMan:
      return "dead-man switch released";
    case SafetyRule::kEmergencyStop:
      return "emergency stop";
    case SafetyRule::kForcesOff:
      return "forces off";
    case SafetyRule::kNotArmed:
      return "not armed";
  }
  return "unknown rule";
}

SafetyLimits safetyLimits(const DeviceCaps& caps) noexcept {
  SafetyLimits limits;
  limits.dof_mask = caps.dof_mask;
  limits.peak_force = std::min(caps.peak_force, caps.command_limit);
  limits.continuous_force = std::min(caps.continuous_force, limits.peak_force);
  limits.torque = caps.torque;
  limits.thermal_time = caps.thermal_time;
  limits.force_slew = caps.force_slew;
  limits.torque_slew = caps.torque_slew;
  limits.stiffness = maxPassiveStiffness(caps.max_stiffness, caps.physical_damping, caps);
  limits.rotational_stiffness =
      maxPassiveStiffness(caps.max_rotational_stiffness, caps.physical_rotational_damping, caps);
  limits.injected_damping = caps.injected_damping;
  limits.injected_rotational_damping = caps.injected_rotational_damping;
  limits.max_speed = caps.max_speed;
  limits.wall_radius = kWallRadiusFraction * caps.workspace_radius;
  limits.wall_stiffness = 0.5 * limits.stiffness;
  limits.clutch_force = caps.clutch_force;
  limits.clutch_warning = caps.clutch_warning;
  limits.force_quantum = caps.force_quantum;
  limits.energy_capacity = limits.peak_force * kStorageTravel;
  limits.active_power = limits.peak_force * kActiveSpeed;
  if (limits.peak_force > 0.0) {
    // a wrist is not re-anchored: it is turned no harder than a hand is pushed, and by no larger share of
    // what the device can do
    const double lever = std::min(kWristLever, limits.torque / limits.peak_force);
    limits.start_torque = limits.start_force * lever;
    limits.start_torque_slew = limits.start_force_slew * lever;
  }
  return limits;
}

bool isFinite(const Wrench& wrench) noexcept { return wrench.force.allFinite() && wrench.torque.allFinite(); }

double ageFactor(double age, const SafetyLimits& limits) noexcept {
  // the order of comparisons makes NaN stale
  if (age <= limits.fade_from) return 1.0;
  if (age < limits.stale_at) return (limits.stale_at - age) / (limits.stale_at - limits.fade_from);
  return 0.0;
}

double stiffnessFactor(double K, double limit) noexcept {
  if (K <= limit) return 1.0;
  return K > limit ? limit / K : 0.0;  // NaN gives no force
}

double softStartFactor(double since_start, const SafetyLimits& limits) noexcept {
  return std::clamp(since_start / limits.soft_start, 0.0, 1.0);
}

Vector3 slewLimited(const Vector3& output, const Vector3& target, double step) noexcept {
  const double size = target.norm();
  if (size <= 0.0) return Vector3::Zero();
  const Vector3 direction = target / size;
  // the component along the target is kept, all others drop at once
  const double kept = std::clamp(output.dot(direction), 0.0, size);
  return direction * std::min(size, kept + step);
}

double wallForce(double distance, const SafetyLimits& limits) noexcept {
  if (limits.wall_radius <= 0.0) return 0.0;
  return limits.wall_stiffness * std::max(0.0, distance - limits.wall_radius);
}

Vector3 wallForce(const Vector3& p_DH, const SafetyLimits& limits) noexcept {
  const double force = wallForce(p_DH.norm(), limits);
  return force > 0.0 ? Vector3(-force * p_DH.normalized()) : Vector3::Zero();
}

double wallStiffnessBeside(const Vector3& scene, double stiffness, const Vector3& p_DH,
                           const SafetyLimits& limits) noexcept {
  const double outwards = scene.dot(p_DH.normalized());
  if (!(stiffness > 0.0) || !(outwards > kSmallForce)) return limits.wall_stiffness;
  // largest k for which K - K_s n n^T - k r r^T has no negative eigenvalue
  const double along = outwards * outwards / scene.squaredNorm();
  const double K = limits.stiffness;
  const double left = 1.0 / ((1.0 - along) / K + along / (K - std::min(stiffness, K)));
  return std::min(left, limits.wall_stiffness);
}

Vector3 quantizeForce(const Vector3& force, double quantum) noexcept {
  const auto quantized = [quantum](double newton) {
    return std::trunc(std::clamp(newton / quantum, -kMaxMotorCounts, kMaxMotorCounts)) * quantum;
  };
  return force.unaryExpr(quantized);
}

void MotorThermalModel::update(double force, double dt, const SafetyLimits& limits) noexcept {
  if (limits.thermal_time <= 0.0 || limits.continuous_force <= 0.0) return;
  const double load = force / limits.continuous_force;
  heat_ += (load * load - heat_) * std::min(1.0, dt / limits.thermal_time);
}

double MotorThermalModel::forceLimit(const SafetyLimits& limits) const noexcept {
  const double reserve = std::clamp((1.0 - heat_) / (1.0 - kDeratingStart), 0.0, 1.0);
  return limits.continuous_force + reserve * (limits.peak_force - limits.continuous_force);
}

void PassivityObserver::observe(const Wrench& output, const Displacement& motion, double dt,
                                const SafetyLimits& limits) noexcept {
  const double delivered = output.force.dot(motion.translation) + output.torque.dot(motion.rotation);
  if (!std::isfinite(delivered)) return;
  // the active power reduces a deficit and never adds to the stored energy
  if (energy_ - delivered < 0.0)
    energy_ = std::min(0.0, energy_ - delivered + limits.active_power * dt);
  else
    energy_ = std::min(energy_ - delivered, limits.energy_capacity);
  energy_ = std::max(energy_, -limits.energy_capacity);
}

Wrench PassivityObserver::damping(const Twist& V_DH, double dt, const SafetyLimits& limits) const noexcept {
  if (energy_ >= 0.0) return {};
  const double share = std::min(1.0, -energy_ / (limits.peak_force * kDeficitTravel));
  const Wrench wrench{-share * limits.injected_damping * V_DH.linear,
                      -share * limits.injected_rotational_damping * V_DH.angular};
  const double dissipated = -dt * (wrench.force.dot(V_DH.linear) + wrench.torque.dot(V_DH.angular));
  return dissipated > -energy_ ? wrench * (-energy_ / dissipated) : wrench;
}

}  // namespace tenon::devices
