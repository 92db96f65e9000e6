#include "devices/drivers/remote_model.h"

#include <chrono>
#include <numbers>

#include "idl/types/messages/hands.h"

namespace tenon::devices {
namespace {

constexpr double kCycle = 1e-3;        // [s]
constexpr double kFollowTime = 0.010;  // [s] time constant in which the hand goes to the target
constexpr double kFollowSpeed = 0.8;   // [m/s] at most, below the speed at which the safety layer brakes
constexpr double kFollowTurn = 6.0;    // [rad/s] likewise

DeviceCaps remoteCaps() {
  DeviceCaps caps;
  caps.model = "remote hand";
  caps.dof_mask = kAllDofs;
  // a person reaches the scene by a pointer, so the workspace is as large as a scene [assumed]
  caps.workspace_radius = 5.0;
  caps.indexing_radius = 4.0;
  caps.indexing_gain = 1.0;
  caps.rotation_range = std::numbers::pi;
  // what is shown is bounded as on a desk [assumed]; nothing is pushed, so no number is a limit of motors
  caps.continuous_force = 20.0;
  caps.peak_force = 20.0;
  caps.command_limit = 20.0;
  caps.torque = 2.0;
  caps.max_stiffness = 2000.0;
  caps.max_rotational_stiffness = 20.0;
  caps.physical_damping = 1.0;
  caps.physical_rotational_damping = 0.01;
  caps.max_speed = 1.0;
  caps.rate = 1.0 / kCycle;
  caps.dead_man = kRemoteHeld;
  caps.arming = kRemoteArm;
  caps.grip_range = 1.0;
  return caps;
}

}  // namespace

RemoteModel::RemoteModel(const RemoteLimits& limits) : caps_(remoteCaps()), limits_(limits) {
  caps_.max_stiffness = limits.stiffness;
}

Result<void> RemoteModel::arm() {
  if (state_.fault != DeviceFault::kNone)
    return fail(caps_.model + ": cannot be armed after a fault (" + toString(state_.fault) +
                "), an operator resets it first");
  if (!state_.forces_on) cycles_since_write_ = 0;
  state_.forces_on = true;
  return {};
}

void RemoteModel::disarm() noexcept {
  state_.forces_on = false;
  view_.F_Ho_D = {};
}

Result<void> RemoteModel::resetFault() {
  state_.fault = DeviceFault::kNone;
  return {};
}

void RemoteModel::meetPeer() noexcept {
  has_peer_ = true;
  silence_ = 0;
  awaits_release_ = true;
  target_ = {};
  target_.X_DT = state_.X_DH;
}

void RemoteModel::losePeer() noexcept {
  has_peer_ = false;
  target_.buttons = 0;
}

void RemoteModel::lead(const RemoteTarget& target) noexcept {
  target_ = target;
  silence_ = 0;
  if ((target.buttons & caps_.arming) == 0) awaits_release_ = false;
  state_.stamp = std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

/// The target, as near to the proxy as the limits demand.
Pose RemoteModel::goal() const noexcept {
  if (!view_.shown.active) return target_.X_DT;
  const Displacement off = displacement(view_.shown.X_DS, target_.X_DT);
  if (off.translation.norm() <= limits_.reach && off.rotation.norm() <= limits_.turn) return target_.X_DT;
  return displaced(view_.shown.X_DS,
                   {clampNorm(off.translation, limits_.reach), clampNorm(off.rotation, limits_.turn)});
}

void RemoteModel::follow() noexcept {
  const double share = kCycle / (kCycle + kFollowTime);
  const bool led = has_peer_ && silence_ < limits_.silent;
  const Displacement off = led ? displacement(state_.X_DH, goal()) : Displacement{};
  const Displacement step = led ? Displacement{clampNorm(share * off.translation, kFollowSpeed * kCycle),
                                               clampNorm(share * off.rotation, kFollowTurn * kCycle)}
                                : Displacement{};
  state_.X_DH = displaced(state_.X_DH, step);
  state_.V_DH = {step.translation / kCycle, step.rotation / kCycle};
}

void RemoteModel::read(DeviceState& state) noexcept {
  ++state_.seq;
  if (state_.forces_on && ++cycles_since_write_ > kWatchdog) {
    disarm();
    state_.fault = DeviceFault::kStale;
  }
  receive();
  if (has_peer_ && ++silence_ > limits_.gone) giveUp();
  if (!has_peer_ || silence_ >= limits_.silent) {
    target_.buttons = 0;
    awaits_release_ = true;
  }
  follow();
  state_.buttons = target_.buttons & ~(awaits_release_ ? caps_.arming : 0U);
  state_.grip = target_.grip;
  state = state_;
}

void RemoteModel::write(const DeviceCommand& command) noexcept {
  const bool finite = command.F_Ho_D.force.allFinite() && command.F_Ho_D.torque.allFinite();
  if (state_.forces_on) {
    cycles_since_write_ = 0;
    view_.F_Ho_D = finite ? command.F_Ho_D : Wrench{};
    if (!finite) {
      disarm();
      state_.fault = DeviceFault::kNonFinite;
    }
  }
  if (!has_peer_) return;
  view_.seq = target_.seq;
  view_.forces_on = state_.forces_on;
  view_.faulty = state_.fault != DeviceFault::kNone;
  view_.cycle = state_.seq;
  view_.X_DH = state_.X_DH;
  send(view_);
}

}  // namespace tenon::devices
