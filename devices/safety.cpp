#include "devices/safety.h"

#include "idl/types/messages.h"

namespace tenon {
namespace {

constexpr double kReleaseShare = 0.5;         ///< of the speed limit, below which the brake lets go
constexpr std::uint64_t kQuietTicks = 500;    ///< a rule that rested as long has ended
constexpr std::uint64_t kTellEvery = 10'000;  ///< [ticks] of a rule that is part of every day's work

/// Works in every session, without anything being wrong.
constexpr bool isRoutine(SafetyRule rule) noexcept {
  constexpr std::uint32_t kRoutine =
      bit(SafetyRule::kAged) | bit(SafetyRule::kStiffnessLowered) | bit(SafetyRule::kSoftStart) |
      bit(SafetyRule::kSlewed) | bit(SafetyRule::kPassivity) | bit(SafetyRule::kWorkspaceWall) |
      bit(SafetyRule::kForceLimited) | bit(SafetyRule::kWordClamped) | bit(SafetyRule::kClutchWarning);
  return (bit(rule) & kRoutine) != 0;
}

}  // namespace

Safety::Safety(const DeviceCaps& caps, ClutchLatch* clutch) noexcept
    : limits_(safetyLimits(caps)), clutch_(clutch) {}

DeviceCommand Safety::step(const SafetyRequest& request, const DeviceState& state, double dt) noexcept {
  ++tick_;
  flags_ = 0;
  watchPort(state, dt);

  DeviceCommand command;
  command.brake = mustBrake(request, state) || request.wanted.brake;
  const bool push = mayPush(request, state) && !command.brake;
  if (push) {
    command.F_Ho_D = bounded(steadied(started(fit(request), dt), state, dt), dt);
    command.tactors = request.wanted.tactors;
  } else {
    since_start_ = 0.0;
    grown_ = {};
    heat_.warm(0.0, dt, limits_);
  }
  shown_ = command.F_Ho_D;
  tell(request.wanted.F_Ho_D.force.norm());
  return command;
}

void Safety::raise(SafetyRule rule, bool acts) noexcept {
  if (acts) flags_ |= bit(rule);
}

void Safety::watchPort(const DeviceState& state, double dt) noexcept {
  if (!state.X_DH.isFinite()) return;
  if (seen_) passivity_.observe(shown_, displacement(X_DH_last_, state.X_DH), dt, limits_);
  X_DH_last_ = state.X_DH;
  seen_ = true;
}

bool Safety::mustBrake(const SafetyRequest& request, const DeviceState& state) noexcept {
  // emergency stop
  stopped_ = stopped_ || request.emergency_stop || state.fault == DeviceFault::kEmergencyStop;
  raise(SafetyRule::kEmergencyStop, stopped_);

  // clutch: written so that a measured force that is no number opens it
  if (limits_.clutch_force > 0.0) {
    const double force = state.F_Ho_D_measured.force.norm();
    if (!(force <= limits_.clutch_force) || state.fault == DeviceFault::kClutchOpen) clutch_released_ = true;
    raise(SafetyRule::kClutchWarning, !(force <= limits_.clutch_warning));
    if (clutch_) {
      clutch_->open = clutch_->open || clutch_released_;
      clutch_released_ = false;
    }
  }
  const bool open = clutch_released_ || (clutch_ && clutch_->open);
  raise(SafetyRule::kClutchOpen, open);

  // velocity, with a gap between braking and letting go; one that is no number brakes
  const double speed = state.V_DH.linear.norm();
  braking_ = !(speed <= (braking_ ? kReleaseShare : 1.0) * limits_.max_speed);
  raise(SafetyRule::kOverspeed, braking_);
  return stopped_ || open || braking_;
}

bool Safety::mayPush(const SafetyRequest& request, const DeviceState& state) noexcept {
  raise(SafetyRule::kDeadMan, !request.dead_man);
  const bool off = !state.forces_on || state.fault != DeviceFault::kNone || !state.X_DH.isFinite();
  raise(SafetyRule::kForcesOff, off);
  raise(SafetyRule::kStale, !(request.age < limits_.stale_at));
  return request.dead_man && !off;
}

Wrench Safety::fit(const SafetyRequest& request) noexcept {
  Wrench wanted = request.wanted.F_Ho_D;
  if (!isFinite(wanted)) {
    raise(SafetyRule::kNotFinite, true);
    return {};
  }
  if (limits_.dof_mask != kAllDofs) {
    for (int axis = 0; axis < 3; ++axis) {
      if ((limits_.dof_mask >> axis & 1U) == 0) wanted.force[axis] = 0.0;
      if ((limits_.dof_mask >> (axis + 3) & 1U) == 0) wanted.torque[axis] = 0.0;
    }
  }
  const double fresh = ageFactor(request.age, limits_);
  raise(SafetyRule::kAged, fresh < 1.0);
  const double soft = stiffnessFactor(request.stiffness, limits_.stiffness);
  const double soft_turning = stiffnessFactor(request.rotational_stiffness, limits_.rotational_stiffness);
  raise(SafetyRule::kStiffnessLowered, soft < 1.0 || (soft_turning < 1.0 && limits_.torque > 0.0));
  return {wanted.force * (fresh * soft), wanted.torque * (fresh * soft_turning)};
}

Wrench Safety::started(const Wrench& wanted, double dt) noexcept {
  since_start_ += dt;
  const double start = softStartFactor(since_start_, limits_);
  raise(SafetyRule::kSoftStart, start < 1.0);
  const Wrench begun = wanted * start;
  grown_ = {slewed(grown_.force, begun.force, limits_.force_slew * dt),
            slewed(grown_.torque, begun.torque, limits_.torque_slew * dt)};
  raise(SafetyRule::kSlewed, grown_.force != begun.force || grown_.torque != begun.torque);
  return grown_;
}

Wrench Safety::steadied(const Wrench& wanted, const DeviceState& state, double dt) noexcept {
  const Wrench damping = passivity_.damping(state.V_DH, dt, limits_);
  raise(SafetyRule::kPassivity, !damping.force.isZero(0.0) || !damping.torque.isZero(0.0));
  const Vector3 wall = wallForce(state.X_DH.translation(), limits_);
  raise(SafetyRule::kWorkspaceWall, !wall.isZero(0.0));
  return wanted + damping + Wrench{wall, Vector3::Zero()};
}

Wrench Safety::bounded(const Wrench& wanted, double dt) noexcept {
  const double warm_limit = heat_.forceLimit(limits_);
  const double force = wanted.force.norm();
  raise(SafetyRule::kForceLimited, force > limits_.peak_force || wanted.torque.norm() > limits_.torque);
  raise(SafetyRule::kThermal, force > warm_limit && warm_limit < limits_.peak_force);
  Wrench shown{limited(wanted.force, warm_limit), limited(wanted.torque, limits_.torque)};
  if (limits_.force_quantum > 0.0) {
    const Vector3 words = inWords(shown.force, limits_.force_quantum);
    raise(SafetyRule::kWordClamped, (shown.force - words).cwiseAbs().maxCoeff() > limits_.force_quantum);
    shown.force = words;
  }
  heat_.warm(shown.force.norm(), dt, limits_);
  return shown;
}

bool Safety::wantsDisarm() const noexcept {
  return (flags_ &
          (bit(SafetyRule::kStale) | bit(SafetyRule::kEmergencyStop) | bit(SafetyRule::kClutchOpen))) != 0;
}

void Safety::reset() noexcept {
  stopped_ = false;
  clutch_released_ = false;
  if (clutch_) clutch_->open = false;
  braking_ = false;
  since_start_ = 0.0;
  grown_ = {};
  passivity_.forget();
}

void Safety::tell(double wanted_force) noexcept {
  for (int i = 0; i < kSafetyRules; ++i) {
    const auto rule = static_cast<SafetyRule>(1U << static_cast<unsigned>(i));
    Episode& episode = episodes_[static_cast<std::size_t>(i)];
    if (acts(rule)) {
      if (!episode.open) begin(episode, rule, wanted_force);
      ++episode.acted;
      episode.last = tick_;
    } else if (episode.open && tick_ - episode.last > kQuietTicks) {
      episode.open = false;
      if (episode.told) push({.tick = episode.last, .rule = rule, .began = false, .acted = episode.acted});
    }
  }
}

void Safety::begin(Episode& episode, SafetyRule rule, double wanted_force) noexcept {
  episode.open = true;
  episode.acted = 0;
  episode.told = !isRoutine(rule) || episode.told_at == 0 || tick_ - episode.told_at >= kTellEvery;
  if (!episode.told) {
    ++episode.untold;
    return;
  }
  push({.tick = tick_,
        .rule = rule,
        .before = wanted_force,
        .after = shown_.force.norm(),
        .untold = episode.untold});
  episode.untold = 0;
  episode.told_at = tick_;
}

void Safety::push(const Intervention& intervention) noexcept {
  if (told_ - taken_ == kRing) {
    ++taken_;
    ++lost_;
  }
  ring_[told_++ % kRing] = intervention;
}

bool Safety::next(Intervention& intervention) noexcept {
  if (taken_ == told_) return false;
  intervention = ring_[taken_++ % kRing];
  return true;
}

}  // namespace tenon
