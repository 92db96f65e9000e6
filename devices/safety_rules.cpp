#include "devices/safety_rules.h"

#include <algorithm>
#include <cmath>

#include "idl/types/messages.h"

namespace tenon {
namespace {

constexpr double kLargestWord = 4096.0;
constexpr double kWallShare = 0.95;       ///< of the workspace's radius is free
constexpr double kCapacityTravel = 0.02;  ///< [m] of full force are remembered as taken
constexpr double kActiveSpeed = 0.01;     ///< [m/s] at full force may be given for ever
constexpr double kWarm = 0.8;             ///< heat from which the limit sinks
constexpr double kStill = 1e-4;           ///< [m/s], [rad/s] below which damping does nothing

/// K <= b / (T/2 + delay): Colgate's condition with a delay added.
double passiveStiffness(double most, double damping, const DeviceCaps& caps) {
  if (most <= 0.0 || caps.rate <= 0.0) return 0.0;
  return std::min(most, damping / (0.5 / caps.rate + caps.delay));
}

}  // namespace

const char* toString(SafetyRule rule) noexcept {
  switch (rule) {
    case SafetyRule::kNotFinite:
      return "force is not a number";
    case SafetyRule::kAged:
      return "force is old and fades";
    case SafetyRule::kStale:
      return "force is too old";
    case SafetyRule::kStiffnessLowered:
      return "stiffness lowered";
    case SafetyRule::kSoftStart:
      return "soft start";
    case SafetyRule::kSlewed:
      return "growth of force limited";
    case SafetyRule::kPassivity:
      return "damping added";
    case SafetyRule::kWorkspaceWall:
      return "end of the workspace";
    case SafetyRule::kForceLimited:
      return "force limited";
    case SafetyRule::kThermal:
      return "motors are warm";
    case SafetyRule::kWordClamped:
      return "motor word at its end";
    case SafetyRule::kOverspeed:
      return "too fast, braking";
    case SafetyRule::kClutchWarning:
      return "force near what opens the clutch";
    case SafetyRule::kClutchOpen:
      return "clutch open";
    case SafetyRule::kDeadMan:
      return "dead-man switch released";
    case SafetyRule::kEmergencyStop:
      return "emergency stop";
    case SafetyRule::kForcesOff:
      return "forces are off";
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
  limits.stiffness = passiveStiffness(caps.max_stiffness, caps.physical_damping, caps);
  limits.rotational_stiffness =
      passiveStiffness(caps.max_rotational_stiffness, caps.physical_rotational_damping, caps);
  limits.injected_damping = caps.injected_damping;
  limits.injected_rotational_damping = caps.injected_rotational_damping;
  limits.max_speed = caps.max_speed;
  limits.wall_radius = kWallShare * caps.workspace_radius;
  limits.wall_stiffness = 0.5 * limits.stiffness;  // the scene's own walls may push at the same time
  limits.clutch_force = caps.clutch_force;
  limits.clutch_warning = caps.clutch_warning;
  limits.force_quantum = caps.force_quantum;
  limits.energy_capacity = limits.peak_force * kCapacityTravel;
  limits.active_power = limits.peak_force * kActiveSpeed;
  return limits;
}

bool isFinite(const Wrench& wrench) noexcept { return wrench.force.allFinite() && wrench.torque.allFinite(); }

double ageFactor(double age, const SafetyLimits& limits) noexcept {
  // written so that an age that is no number counts as stale
  if (age <= limits.fade_from) return 1.0;
  if (age < limits.stale_at) return (limits.stale_at - age) / (limits.stale_at - limits.fade_from);
  return 0.0;
}

double stiffnessFactor(double K, double limit) noexcept {
  if (K <= limit) return 1.0;
  return K > limit ? limit / K : 0.0;  // a stiffness that is no number shows nothing
}

double softStartFactor(double since_start, const SafetyLimits& limits) noexcept {
  return std::clamp(since_start / limits.soft_start, 0.0, 1.0);
}

Vector3 slewed(const Vector3& shown, const Vector3& wanted, double step) noexcept {
  const double size = wanted.norm();
  if (size <= 0.0) return Vector3::Zero();
  const Vector3 direction = wanted / size;
  // what there is already in the wanted direction; anything else has fallen at once
  const double kept = std::clamp(shown.dot(direction), 0.0, size);
  return direction * std::min(size, kept + step);
}

Vector3 wallForce(const Vector3& p_DH, const SafetyLimits& limits) noexcept {
  const double beyond = p_DH.norm() - limits.wall_radius;
  if (limits.wall_radius <= 0.0 || beyond <= 0.0) return Vector3::Zero();
  return p_DH.normalized() * (-limits.wall_stiffness * beyond);
}

Vector3 limited(const Vector3& v, double limit) noexcept {
  const double size = v.norm();
  return size > limit ? Vector3(v * (limit / size)) : v;
}

Vector3 inWords(const Vector3& force, double quantum) noexcept {
  const auto word = [quantum](double newton) {
    return std::trunc(std::clamp(newton / quantum, -kLargestWord, kLargestWord)) * quantum;
  };
  return force.unaryExpr(word);
}

void MotorHeat::warm(double force, double dt, const SafetyLimits& limits) noexcept {
  if (limits.thermal_time <= 0.0 || limits.continuous_force <= 0.0) return;
  const double share = force / limits.continuous_force;
  heat_ += (share * share - heat_) * std::min(1.0, dt / limits.thermal_time);
}

double MotorHeat::forceLimit(const SafetyLimits& limits) const noexcept {
  const double cool = std::clamp((1.0 - heat_) / (1.0 - kWarm), 0.0, 1.0);
  return limits.continuous_force + cool * (limits.peak_force - limits.continuous_force);
}

void PassivityObserver::observe(const Wrench& shown, const Displacement& motion, double dt,
                                const SafetyLimits& limits) noexcept {
  const double given = shown.force.dot(motion.translation) + shown.torque.dot(motion.rotation);
  // the allowance pays debts and never makes savings
  if (energy_ - given < 0.0)
    energy_ = std::min(0.0, energy_ - given + limits.active_power * dt);
  else
    energy_ = std::min(energy_ - given, limits.energy_capacity);
  energy_ = std::max(energy_, -limits.energy_capacity);
}

Wrench PassivityObserver::damping(const Twist& V_DH, double dt, const SafetyLimits& limits) const noexcept {
  if (energy_ >= 0.0) return {};
  Wrench wrench;
  double debt = -energy_;
  const double speed2 = V_DH.linear.squaredNorm();
  if (speed2 > kStill * kStill) {
    const double damping = std::min(debt / (dt * speed2), limits.injected_damping);
    wrench.force = -damping * V_DH.linear;
    debt -= damping * speed2 * dt;
  }
  const double turning2 = V_DH.angular.squaredNorm();
  if (turning2 > kStill * kStill) {
    const double damping = std::min(debt / (dt * turning2), limits.injected_rotational_damping);
    wrench.torque = -damping * V_DH.angular;
  }
  return wrench;
}

}  // namespace tenon
