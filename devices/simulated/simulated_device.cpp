#include "devices/simulated/simulated_device.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <utility>

#include "idl/types/messages.h"

namespace tenon {
namespace {

constexpr double kPeriod = 1e-3;
constexpr int kSubsteps = 4;
/// An electromagnetic brake shorts the windings; on a strong arm it is a real brake [assumed].
constexpr double kBrakeDamping = 400.0;
constexpr double kBrakeRotationalDamping = 2.0;
/// Rubber at the end of the travel [assumed].
constexpr double kStopStiffness = 3000.0;
constexpr double kStopDamping = 20.0;
constexpr double kStopRotationalStiffness = 20.0;
/// Sticking holds a third more than sliding, and the difference is gone at about this speed [assumed].
constexpr double kStickingShare = 0.3;
constexpr double kStribeckSpeed = 2e-3;
constexpr double kStribeckRotationSpeed = 2e-2;
constexpr double kForceNoise = 0.05;  ///< [N] of a six-axis sensor at the wrist, uniform [assumed]
constexpr double kLargestWord = 4096.0;

std::uint64_t splitMix(std::uint64_t& state) {
  state += 0x9E3779B97F4A7C15ULL;
  std::uint64_t z = state;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

/// Uniform in [-1, 1).
double uniform(std::uint64_t& state) { return static_cast<double>(splitMix(state) >> 11U) * 0x1.0p-52 - 1.0; }

Vector3 saturated(const Vector3& v, double limit) {
  const double length = v.norm();
  return length > limit ? Vector3(v * (limit / length)) : v;
}

Vector3 rounded(const Vector3& v, double step) {
  if (step <= 0.0) return v;
  return (v / step).unaryExpr([](double x) { return std::floor(x + 0.5); }) * step;
}

/// What dry friction leaves of a velocity: all the momentum it can take in `dt`, so it sticks without
/// chatter.
Vector3 rubbed(const Vector3& v, double inertia, double friction, double stribeck_speed, double dt) {
  const double speed = v.norm();
  if (speed <= 0.0) return v;
  const double slide = speed / stribeck_speed;
  const double lost = dt * friction * (1.0 + kStickingShare / (1.0 + slide * slide)) / inertia;
  return lost >= speed ? Vector3::Zero() : Vector3(v * (1.0 - lost / speed));
}

/// One kind of motion (along or about) of the body of hand and handle.
struct Motion {
  double own_inertia, hand_inertia;
  double own_damping;
  ArmImpedance arm;
  double friction, stribeck_speed;
};

/// Semi-implicit: dampers and the arm's spring at the end of the step, so no stiffness of a person makes it
/// blow up. Returns what the handle does to the hand.
Vector3 stepMotion(const Motion& motion, const Vector3& load, const Vector3& reach, const Vector3& v_intent,
                   double dt, Vector3& v) {
  const double inertia = motion.own_inertia + motion.hand_inertia;
  const auto& [stiffness, damping] = motion.arm;
  const Vector3 before = v;
  v = (inertia * v + dt * (load + stiffness * reach + damping * v_intent)) /
      (inertia + dt * (motion.own_damping + damping) + dt * dt * stiffness);
  v = rubbed(v, inertia, motion.friction, motion.stribeck_speed, dt);
  const Vector3 pull = stiffness * (reach - dt * v) + damping * (v_intent - v);
  return motion.hand_inertia / dt * (v - before) - pull;
}

}  // namespace

SimulatedDevice::SimulatedDevice(SimulatedModel model, std::uint64_t seed,
                                 std::shared_ptr<MagneticClutch> clutch)
    : model_(std::move(model)), clutch_(std::move(clutch)), random_(seed) {
  assert(model_.velocity_window >= 1 && model_.velocity_window <= kLongestWindow);
  assert(model_.delay <= kLongestDelay);
  const double specimen = 1.0 + 0.1 * uniform(random_);
  model_.friction *= specimen;
  model_.rotational_friction *= specimen;
}

Result<void> SimulatedDevice::open() {
  if (phase_ != Phase::kClosed) return fail(model_.caps.model + ": is open already");
  phase_ = Phase::kOpen;
  state_.fault = DeviceFault::kNone;
  readings_.fill(counted(X_DH_));
  return {};
}

void SimulatedDevice::close() noexcept {
  disarm();
  phase_ = Phase::kClosed;
}

void SimulatedDevice::unplug() noexcept {
  close();
  state_.fault = DeviceFault::kCommunication;
}

Result<void> SimulatedDevice::arm() {
  if (phase_ == Phase::kClosed) return fail(model_.caps.model + ": cannot be armed, it is not open");
  if (phase_ == Phase::kFault)
    return fail(model_.caps.model + ": cannot be armed after a fault (" + toString(state_.fault) +
                "), an operator resets it first");
  if (phase_ == Phase::kArmed) return {};
  phase_ = Phase::kArmed;
  braked_ = false;
  ticks_since_write_ = 0;
  return {};
}

void SimulatedDevice::disarm() noexcept {
  if (phase_ == Phase::kArmed) phase_ = Phase::kOpen;
  commands_.fill({});
  F_Ho_D_newest_ = {};
  F_Ho_D_motor_ = {};
}

Result<void> SimulatedDevice::resetFault() {
  if (phase_ == Phase::kClosed) return fail(model_.caps.model + ": cannot be reset, it is not open");
  if (phase_ != Phase::kFault) return {};
  if (clutch_) {
    clutch_->open = false;
    clutch_openings_seen_ = clutch_->openings;
    hand_.moved(X_DH_, {}, {});
  }
  phase_ = Phase::kOpen;
  braked_ = false;
  state_.fault = DeviceFault::kNone;
  return {};
}

void SimulatedDevice::fault(DeviceFault why) noexcept {
  disarm();
  phase_ = Phase::kFault;
  state_.fault = why;
}

bool SimulatedDevice::rotates() const noexcept { return model_.caps.dof_mask != kTranslationDofs; }

double SimulatedDevice::noise() noexcept { return uniform(random_); }

void SimulatedDevice::read(DeviceState& state) noexcept {
  if (phase_ != Phase::kClosed) {
    ++state_.seq;
    checkWatchdog();
    checkClutch();
    advance();
    sense();
  }
  state_.forces_on = phase_ == Phase::kArmed;
  state = state_;
}

void SimulatedDevice::write(const DeviceCommand& command) noexcept {
  if (phase_ != Phase::kArmed) return;
  ticks_since_write_ = 0;
  if (!command.F_Ho_D.force.allFinite() || !command.F_Ho_D.torque.allFinite()) {
    fault(DeviceFault::kNotANumber);
    return;
  }
  braked_ = command.brake;
  F_Ho_D_newest_ = drivable(command.F_Ho_D);
}

void SimulatedDevice::checkWatchdog() noexcept {
  if (phase_ == Phase::kArmed && ++ticks_since_write_ > kWatchdog) fault(DeviceFault::kStale);
}

void SimulatedDevice::checkClutch() noexcept {
  if (!clutch_) return;
  const bool too_strong = state_.F_Ho_D_measured.force.norm() > model_.caps.clutch_force;
  if (too_strong && !clutch_->open) {
    clutch_->open = true;
    ++clutch_->openings;
  }
  if (clutch_openings_seen_ == clutch_->openings) return;
  clutch_openings_seen_ = clutch_->openings;
  fault(DeviceFault::kClutchOpen);
}

void SimulatedDevice::advance() noexcept {
  if (state_.fault == DeviceFault::kClutchOpen) {
    // the robot stands still where it was; the hand is alone
    V_DH_ = {};
    hand_.moveFreely(kPeriod);
    return;
  }
  // the newest command enters the delay line, the one due now leaves it
  const std::size_t now = state_.seq % commands_.size();
  commands_[(now + model_.delay) % commands_.size()] = F_Ho_D_newest_;
  const bool pushing = phase_ == Phase::kArmed && !braked_;
  F_Ho_D_motor_ = pushing ? commands_[now] : Wrench{};

  Wrench felt;
  for (int substep = 0; substep < kSubsteps; ++substep) felt += moveHandle(kPeriod / kSubsteps);
  hand_.moved(X_DH_, V_DH_, felt * (1.0 / kSubsteps));
}

Wrench SimulatedDevice::moveHandle(double dt) noexcept {
  const Displacement reach = hand_.reach(X_DH_);
  const Twist& V_DI = hand_.intentVelocity();
  const Wrench load = F_Ho_D_motor_ + endStops();
  const HumanArmModel& arm = hand_.model();
  Wrench felt;
  const Motion along{
      model_.mass,       arm.mass,        model_.caps.physical_damping + (braked_ ? kBrakeDamping : 0.0),
      hand_.impedance(), model_.friction, kStribeckSpeed};
  felt.force = stepMotion(along, load.force, reach.translation, V_DI.linear, dt, V_DH_.linear);
  if (rotates()) {
    const Motion about{model_.inertia,
                       arm.inertia,
                       model_.caps.physical_rotational_damping + (braked_ ? kBrakeRotationalDamping : 0.0),
                       hand_.rotationalImpedance(),
                       model_.rotational_friction,
                       kStribeckRotationSpeed};
    felt.torque = stepMotion(about, load.torque, reach.rotation, V_DI.angular, dt, V_DH_.angular);
  }
  X_DH_ = displaced(X_DH_, {dt * V_DH_.linear, dt * V_DH_.angular});
  return felt;
}

Wrench SimulatedDevice::endStops() const noexcept {
  Wrench stop;
  const Vector3& p = X_DH_.translation();
  const double beyond = p.norm() - model_.caps.workspace_radius;
  if (beyond > 0.0) {
    const Vector3 outward = p.normalized();
    const double outward_speed = std::max(0.0, V_DH_.linear.dot(outward));
    stop.force = -(kStopStiffness * beyond + kStopDamping * outward_speed) * outward;
  }
  const Vector3 turned = logRotation(X_DH_.rotation());
  const double turned_beyond = turned.norm() - model_.rotation_range;
  if (turned_beyond > 0.0) stop.torque = -kStopRotationalStiffness * turned_beyond * turned.normalized();
  return stop;
}

Wrench SimulatedDevice::drivable(const Wrench& F_Ho_D) const noexcept {
  const DeviceCaps& caps = model_.caps;
  Wrench motor = F_Ho_D;
  if (caps.force_quantum > 0.0) {
    const double largest = kLargestWord * caps.force_quantum;
    motor.force = rounded(motor.force.cwiseMax(-largest).cwiseMin(largest), caps.force_quantum);
  } else {
    motor.force = saturated(motor.force, caps.peak_force);
  }
  motor.torque = rotates() ? saturated(motor.torque, caps.torque) : Vector3(Vector3::Zero());
  return motor;
}

Pose SimulatedDevice::counted(const Pose& X_DH) const noexcept {
  const Vector3 p = rounded(X_DH.translation(), model_.position_resolution);
  if (!rotates() || model_.angle_resolution <= 0.0) return {p, X_DH.rotation()};
  return {p, expRotation(rounded(logRotation(X_DH.rotation()), model_.angle_resolution))};
}

void SimulatedDevice::sense() noexcept {
  state_.X_DH = counted(X_DH_);
  readings_[state_.seq % readings_.size()] = state_.X_DH;
  const std::uint64_t old = state_.seq + readings_.size() - model_.velocity_window;
  const Displacement moved = displacement(readings_[old % readings_.size()], state_.X_DH);
  const double window = model_.velocity_window * kPeriod;
  state_.V_DH = {moved.translation / window, moved.rotation / window};
  const bool holding = state_.fault != DeviceFault::kClutchOpen;
  state_.buttons = holding ? hand_.buttons() : 0;
  state_.F_Ho_D_measured = {};
  if (model_.force_sensor && holding) {
    const Vector3 error = kForceNoise * Vector3(noise(), noise(), noise());
    state_.F_Ho_D_measured = {hand_.felt().force + error, hand_.felt().torque};
  }
}

}  // namespace tenon
