#include "devices/simulated/simulated_device.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <utility>

#include "idl/types/messages/hands.h"

namespace tenon::devices {
namespace {

constexpr double kPeriod = 1e-3;  ///< [s]
constexpr int kSubsteps = 4;
/// Electromagnetic brake by shorted windings, modelled as damping [assumed].
constexpr double kBrakeDamping = 400.0;          ///< [Ns/m]
constexpr double kBrakeRotationalDamping = 2.0;  ///< [Nms/rad]
/// Rubber end stops [assumed].
constexpr double kStopStiffness = 3000.0;          ///< [N/m]
constexpr double kStopDamping = 20.0;              ///< [Ns/m]
constexpr double kStopRotationalStiffness = 20.0;  ///< [Nm/rad]
/// Stribeck curve: static friction exceeds kinetic friction by this fraction, which falls with speed
/// [assumed].
constexpr double kStictionExcess = 0.3;          ///< [-]
constexpr double kStribeckSpeed = 2e-3;          ///< [m/s] where half of the excess is left
constexpr double kStribeckRotationSpeed = 2e-2;  ///< [rad/s] likewise
constexpr double kForceNoise = 0.05;             ///< [N] of a six-axis sensor at the wrist, uniform [assumed]

Vector3 quantize(const Vector3& v, double step) {
  if (step <= 0.0) return v;
  return (v / step).unaryExpr([](double x) { return std::floor(x + 0.5); }) * step;
}

/// Velocity after dry friction has acted for `dt`. The impulse is limited to the momentum, so the body comes
/// to rest without chatter.
Vector3 applyDryFriction(const Vector3& v, double inertia, double friction, double stribeck_speed,
                         double dt) {
  const double speed = v.norm();
  if (speed <= 0.0) return v;
  const double slide = speed / stribeck_speed;
  const double lost = dt * friction * (1.0 + kStictionExcess / (1.0 + slide * slide)) / inertia;
  return lost >= speed ? Vector3::Zero() : Vector3(v * (1.0 - lost / speed));
}

/// Translational or rotational dynamics of the body of hand and handle.
struct HandleDynamics {
  double device_inertia, hand_inertia;
  double device_damping;
  ArmImpedance arm;
  double friction, stribeck_speed;
};

/// Semi-implicit step: dampers and the arm's spring are evaluated at its end, so it is stable for any
/// stiffness of the arm. Returns the force (torque) of the handle on the hand.
Vector3 stepDynamics(const HandleDynamics& dynamics, const Vector3& load, const Vector3& stretch,
                     const Vector3& v_intent, double dt, Vector3& v) {
  const double inertia = dynamics.device_inertia + dynamics.hand_inertia;
  const auto& [stiffness, damping] = dynamics.arm;
  const Vector3 before = v;
  v = (inertia * v + dt * (load + stiffness * stretch + damping * v_intent)) /
      (inertia + dt * (dynamics.device_damping + damping) + dt * dt * stiffness);
  v = applyDryFriction(v, inertia, dynamics.friction, dynamics.stribeck_speed, dt);
  const Vector3 pull = stiffness * (stretch - dt * v) + damping * (v_intent - v);
  return dynamics.hand_inertia / dt * (v - before) - pull;
}

}  // namespace

SimulatedDevice::SimulatedDevice(SimulatedModel model, std::uint64_t seed,
                                 std::shared_ptr<MagneticClutch> clutch)
    : model_(std::move(model)), clutch_(std::move(clutch)), random_(seed) {
  assert(model_.velocity_window >= 1 && model_.velocity_window <= kLongestWindow);
  assert(model_.delay <= kLongestDelay);
  const double variation = 1.0 + 0.1 * noise();
  model_.friction *= variation;
  model_.rotational_friction *= variation;
}

Result<void> SimulatedDevice::open() {
  if (phase_ != Phase::kClosed) return fail(model_.caps.model + ": is already open");
  phase_ = Phase::kOpen;
  state_.fault = DeviceFault::kNone;
  readings_.fill(quantizePose(X_DH_));
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
    arm_.setState(X_DH_, {}, {});
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

void SimulatedDevice::read(DeviceState& state) noexcept {
  if (clock_) clock_->taken();
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
    fault(DeviceFault::kNonFinite);
    return;
  }
  braked_ = command.brake;
  F_Ho_D_newest_ = saturateCommand(command.F_Ho_D);
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
    // the robot stands still, the hand moves alone
    V_DH_ = {};
    arm_.stepFree(kPeriod);
    return;
  }
  // delay line: the newest command enters, the one that is due leaves
  const std::size_t now = state_.seq % commands_.size();
  commands_[(now + model_.delay) % commands_.size()] = F_Ho_D_newest_;
  const bool motors_on = phase_ == Phase::kArmed && !braked_;
  F_Ho_D_motor_ = motors_on ? commands_[now] : Wrench{};

  Wrench handle_wrench;
  for (int substep = 0; substep < kSubsteps; ++substep) handle_wrench += stepHandle(kPeriod / kSubsteps);
  arm_.setState(X_DH_, V_DH_, handle_wrench * (1.0 / kSubsteps));
}

Wrench SimulatedDevice::stepHandle(double dt) noexcept {
  const Displacement stretch = arm_.springStretch(X_DH_);
  const Twist& V_DI = arm_.intentVelocity();
  const Wrench load = F_Ho_D_motor_ + endStops();
  const HumanArmModel& arm = arm_.model();
  Wrench handle_wrench;
  const HandleDynamics translational{
      model_.mass,      arm.mass,        model_.caps.physical_damping + (braked_ ? kBrakeDamping : 0.0),
      arm_.impedance(), model_.friction, kStribeckSpeed};
  handle_wrench.force =
      stepDynamics(translational, load.force, stretch.translation, V_DI.linear, dt, V_DH_.linear);
  if (rotates()) {
    const HandleDynamics rotational{
        model_.inertia,
        arm.inertia,
        model_.caps.physical_rotational_damping + (braked_ ? kBrakeRotationalDamping : 0.0),
        arm_.rotationalImpedance(),
        model_.rotational_friction,
        kStribeckRotationSpeed};
    handle_wrench.torque =
        stepDynamics(rotational, load.torque, stretch.rotation, V_DI.angular, dt, V_DH_.angular);
  }
  X_DH_ = displaced(X_DH_, {dt * V_DH_.linear, dt * V_DH_.angular});
  return handle_wrench;
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
  const double turned_beyond = turned.norm() - model_.caps.rotation_range;
  if (rotates() && turned_beyond > 0.0)
    stop.torque = -kStopRotationalStiffness * turned_beyond * turned.normalized();
  return stop;
}

Wrench SimulatedDevice::saturateCommand(const Wrench& F_Ho_D) const noexcept {
  const DeviceCaps& caps = model_.caps;
  Wrench motor = F_Ho_D;
  if (caps.force_quantum > 0.0) {
    const double range = kMaxMotorCounts * caps.force_quantum;
    motor.force = quantize(motor.force.cwiseMax(-range).cwiseMin(range), caps.force_quantum);
  } else {
    motor.force = clampNorm(motor.force, caps.peak_force);
  }
  motor.torque = rotates() ? clampNorm(motor.torque, caps.torque) : Vector3(Vector3::Zero());
  return motor;
}

Pose SimulatedDevice::quantizePose(const Pose& X_DH) const noexcept {
  const Vector3 p = quantize(X_DH.translation(), model_.position_resolution);
  if (!rotates() || model_.angle_resolution <= 0.0) return {p, X_DH.rotation()};
  return {p, expRotation(quantize(logRotation(X_DH.rotation()), model_.angle_resolution))};
}

void SimulatedDevice::sense() noexcept {
  state_.X_DH = quantizePose(X_DH_);
  readings_[state_.seq % readings_.size()] = state_.X_DH;
  const std::uint64_t oldest = state_.seq + readings_.size() - model_.velocity_window;
  const Displacement moved = displacement(readings_[oldest % readings_.size()], state_.X_DH);
  const double window = model_.velocity_window * kPeriod;
  state_.V_DH = {moved.translation / window, moved.rotation / window};
  const bool holding = state_.fault != DeviceFault::kClutchOpen;
  state_.buttons = holding ? arm_.buttons() : 0;
  state_.F_Ho_D_measured = {};
  if (model_.force_sensor && holding) {
    const Vector3 error = kForceNoise * Vector3(noise(), noise(), noise());
    state_.F_Ho_D_measured = {arm_.handleWrench().force + error, arm_.handleWrench().torque};
  }
}

std::vector<std::string> simulatedSerials() { return {"1001", "1002", "1003", "1004"}; }

std::uint64_t unitSeed(std::uint64_t seed, const std::string& serial) {
  constexpr std::uint64_t kApart = 1'000'003;
  const std::vector<std::string> units = simulatedSerials();
  const auto unit = std::find(units.begin(), units.end(), serial);
  return seed + (unit == units.end() ? 0 : kApart * static_cast<std::uint64_t>(unit - units.begin()));
}

}  // namespace tenon::devices
