#include "devices/safety.h"

#include <algorithm>
#include <cmath>

#include "idl/types/messages/hands.h"

namespace tenon::devices {
namespace {

constexpr double kBrakeReleaseFraction = 0.5;      ///< [-] of the speed limit: the brake is released below
constexpr double kLongestGrowth = 0.002;           ///< [s] of growth in one step
constexpr double kLeavingTime = 0.020;             ///< [s] in which the force before a restart falls to zero
constexpr std::uint64_t kEndAfterTicks = 500;      ///< [ticks] without activity end an intervention
constexpr std::uint64_t kReportInterval = 10'000;  ///< [ticks] between reports of a routine rule

/// Rules that act in normal operation, without a defect.
constexpr bool isRoutine(SafetyRule rule) noexcept {
  constexpr std::uint32_t kRoutine = bit(SafetyRule::kAgeFading) | bit(SafetyRule::kStiffnessLimited) |
                                     bit(SafetyRule::kSoftStart) | bit(SafetyRule::kSlewLimited) |
                                     bit(SafetyRule::kPassivity) | bit(SafetyRule::kWorkspaceWall) |
                                     bit(SafetyRule::kForceLimited) | bit(SafetyRule::kMotorSaturated) |
                                     bit(SafetyRule::kClutchWarning) | bit(SafetyRule::kNotArmed);
  return (bit(rule) & kRoutine) != 0;
}

bool isFiniteRequest(const SafetyRequest& request) noexcept {
  return isFinite(request.requested.F_Ho_D) && std::isfinite(request.stiffness) &&
         std::isfinite(request.rotational_stiffness);
}

}  // namespace

Safety::Safety(const DeviceCaps& caps, ClutchLatch* clutch) noexcept
    : limits_(safetyLimits(caps)), clutch_(clutch) {}

DeviceCommand Safety::step(const SafetyRequest& request, const DeviceState& state, double dt) noexcept {
  ++tick_;
  flags_ = 0;
  observePort(state, dt);

  DeviceCommand command;
  command.brake = evaluateStops(request, state) || request.requested.brake;
  forces_on_ = forcesPermitted(request, state) && !command.brake;
  if (forces_on_) {
    const bool late = !(request.age <= limits_.fade_from);
    const bool finite = isFiniteRequest(request);
    setFlag(SafetyRule::kNonFinite, !finite);
    // a force that is late while it starts may be of any stretch: it starts again once it is fresh
    if (!finite)
      startFromZero();
    else if (request.restart || (late_ && !late) || (late && starting()))
      restart();
    late_ = late;
    const Wrench damping = injectDamping(state, dt);
    const Wrench requested = prepareRequest(request);
    const double wall_growth = rampWall(requested.force, request.stiffness, state, dt);
    const Wrench scene = applySoftStartAndSlew(requested, damping, wall_growth, dt);
    command.F_Ho_D = limitOutput(scene + Wrench{wallBesideScene(), Vector3::Zero()}, dt);
    fadeTactors(request, command);
  } else {
    startFromZero();
    wall_since_ = 0.0;
    wall_.setZero();
    wall_lags_ = false;
    wall_was_slow_ = false;
    wall_distance_ = state.X_DH.translation().norm();
    heat_.update(0.0, dt, limits_);
  }
  output_ = command.F_Ho_D;
  updateEpisodes(request.requested.F_Ho_D.force.norm());
  return command;
}

void Safety::setFlag(SafetyRule rule, bool acts) noexcept {
  if (acts) flags_ |= bit(rule);
}

void Safety::observePort(const DeviceState& state, double dt) noexcept {
  if (!state.X_DH.isFinite()) return;
  if (has_last_pose_) passivity_.observe(output_, displacement(X_DH_last_, state.X_DH), dt, limits_);
  X_DH_last_ = state.X_DH;
  has_last_pose_ = true;
}

bool Safety::evaluateStops(const SafetyRequest& request, const DeviceState& state) noexcept {
  // emergency stop
  stopped_ = stopped_ || request.emergency_stop || state.fault == DeviceFault::kEmergencyStop;
  setFlag(SafetyRule::kEmergencyStop, stopped_);
  setFlag(SafetyRule::kNotArmed, !request.armed);

  // clutch: the order of comparisons makes a NaN measurement open it
  if (limits_.clutch_force > 0.0) {
    const double force = state.F_Ho_D_measured.force.norm();
    if (!(force <= limits_.clutch_force) || state.fault == DeviceFault::kClutchOpen) clutch_tripped_ = true;
    setFlag(SafetyRule::kClutchWarning, !(force <= limits_.clutch_warning));
    if (clutch_) {
      clutch_->open = clutch_->open || clutch_tripped_;
      clutch_tripped_ = false;
    }
  }
  const bool open = clutch_tripped_ || (clutch_ && clutch_->open);
  setFlag(SafetyRule::kClutchOpen, open);

  // speed limit with hysteresis; NaN brakes
  const double speed = state.V_DH.linear.norm();
  braking_ = !(speed <= (braking_ ? kBrakeReleaseFraction : 1.0) * limits_.max_speed) ||
             !state.V_DH.angular.allFinite();
  setFlag(SafetyRule::kOverspeed, braking_);
  return stopped_ || !request.armed || open || braking_;
}

bool Safety::forcesPermitted(const SafetyRequest& request, const DeviceState& state) noexcept {
  setFlag(SafetyRule::kDeadMan, !request.dead_man_held);
  const bool off = !state.forces_on || state.fault != DeviceFault::kNone || !state.X_DH.isFinite();
  setFlag(SafetyRule::kForcesOff, off);
  setFlag(SafetyRule::kStale, !(request.age < limits_.stale_at));
  return request.dead_man_held && !off;
}

Wrench Safety::prepareRequest(const SafetyRequest& request) noexcept {
  Wrench wrench = request.requested.F_Ho_D;
  if (acts(SafetyRule::kNonFinite)) return {};
  if (limits_.dof_mask != kAllDofs) {
    for (int axis = 0; axis < 3; ++axis) {
      if ((limits_.dof_mask >> axis & 1U) == 0) wrench.force[axis] = 0.0;
      if ((limits_.dof_mask >> (axis + 3) & 1U) == 0) wrench.torque[axis] = 0.0;
    }
  }
  // answers of a burst get younger one by one: a force that fades does not come back before it starts again
  const double age_factor =
      request.age <= limits_.fade_from ? 1.0 : std::min(fade_, ageFactor(request.age, limits_));
  fade_ = age_factor;
  setFlag(SafetyRule::kAgeFading, age_factor < 1.0);
  const double stiffness_factor = stiffnessFactor(request.stiffness, limits_.stiffness);
  const double rotational_factor =
      stiffnessFactor(request.rotational_stiffness, limits_.rotational_stiffness);
  setFlag(SafetyRule::kStiffnessLimited,
          stiffness_factor < 1.0 || (rotational_factor < 1.0 && limits_.torque > 0.0));
  return {wrench.force * (age_factor * stiffness_factor), wrench.torque * (age_factor * rotational_factor)};
}

void Safety::restart() noexcept {
  const Wrench rendered = slewed_ + injected_;
  if (!rendered.force.isZero(0.0) || !rendered.torque.isZero(0.0)) {
    leaving_ = rendered + leaving_ * leaving_share_;
    leaving_share_ = 1.0;
  }
  force_starting_ = torque_starting_ = true;
  since_start_ = 0.0;
  slewed_ = injected_ = {};
  passivity_.forgive();
}

void Safety::startFromZero() noexcept {
  restart();
  settled_force_ = 0.0;
  settled_torque_ = 0.0;
  leaving_share_ = 0.0;
}

double Safety::startLimit() const noexcept { return std::max(settled_force_, limits_.start_force); }

Wrench Safety::clampedInRamp(const Wrench& wrench) const noexcept {
  if (!inRamp()) return wrench;
  return {clampNorm(wrench.force, std::max(0.0, startLimit() - wall_.norm())),
          clampNorm(wrench.torque, std::max(settled_torque_, limits_.start_torque))};
}

void Safety::keepSettled() noexcept {
  if (late_) return;
  if (!force_starting_)
    settled_force_ = std::min((slewed_.force + wallBesideScene()).norm(), heat_.forceLimit(limits_));
  if (!torque_starting_) settled_torque_ = std::min(slewed_.torque.norm(), limits_.torque);
}

Wrench Safety::applySoftStartAndSlew(const Wrench& wrench, const Wrench& damping, double wall_growth,
                                     double dt) noexcept {
  keepSettled();
  const double start = softStartFactor(since_start_, limits_);
  const double growth = std::min(dt, kLongestGrowth);
  // while a force starts, its damping is within the limits of the start
  const Wrench growing{force_starting_ ? damping.force : Vector3::Zero(),
                       torque_starting_ ? damping.torque : Vector3::Zero()};
  const Wrench ramped = clampedInRamp(wrench * start + growing);
  since_start_ += growth;
  const double force_step = force_starting_ ? std::max(0.0, limits_.start_force_slew * growth - wall_growth)
                                            : limits_.force_slew * growth;
  const double torque_slew = torque_starting_ ? limits_.start_torque_slew : limits_.torque_slew;
  slewed_ = {slewLimited(slewed_.force, ramped.force, force_step),
             slewLimited(slewed_.torque, ramped.torque, torque_slew * growth)};
  const bool force_behind = slewed_.force != ramped.force;
  const bool torque_behind = slewed_.torque != ramped.torque;
  const bool force_starts = force_starting_ && (start < 1.0 || force_behind);
  const bool torque_starts = torque_starting_ && (start < 1.0 || torque_behind);
  // the damping of one that has started is added to it from now on
  const Wrench started{force_starts ? Vector3::Zero() : growing.force,
                       torque_starts ? Vector3::Zero() : growing.torque};
  slewed_ = slewed_ + -started;
  force_starting_ = force_starts;
  torque_starting_ = torque_starts;
  setFlag(SafetyRule::kSoftStart, starting());
  setFlag(SafetyRule::kSlewLimited,
          (force_behind && !force_starting_) || (torque_behind && !torque_starting_));
  leaving_share_ = std::max(0.0, leaving_share_ - dt / kLeavingTime);
  injected_ = damping + -growing + started;
  return slewed_ + leaving_ * leaving_share_ + injected_;
}

Wrench Safety::injectDamping(const DeviceState& state, double dt) noexcept {
  const Wrench damping = passivity_.damping(state.V_DH, dt, limits_);
  setFlag(SafetyRule::kPassivity, !damping.force.isZero(0.0) || !damping.torque.isZero(0.0));
  return damping;
}

/// A workspace wall that already acts keeps its force over a gap. One first reached during a gap or soft
/// start grows at the soft-start rate, until it is that of its spring, however long this takes.
double Safety::rampWall(const Vector3& scene, double stiffness, const DeviceState& state,
                        double dt) noexcept {
  const Vector3& p_DH = state.X_DH.translation();
  const double growth = std::min(dt, kLongestGrowth);
  const double before = wall_.norm();
  const bool slow = force_starting_ || late_ || wall_since_ < limits_.soft_start;
  if (wall_was_slow_ && !slow && before < wallForce(wall_distance_, limits_)) wall_lags_ = true;
  wall_was_slow_ = slow;
  const double stiffness_left = std::min(wallStiffnessBeside(scene, stiffness, p_DH, limits_),
                                         wallStiffnessBeside(sceneForce(), stiffness, p_DH, limits_));
  wall_ = slewLimited(wall_, limitedBesideScene(wallTarget(p_DH), stiffness_left, p_DH, growth),
                      (slow ? limits_.start_force_slew : limits_.force_slew) * growth);
  wall_since_ += growth;
  wall_distance_ = p_DH.norm();
  setFlag(SafetyRule::kWorkspaceWall, !wall_.isZero(0.0));
  return std::max(0.0, wall_.norm() - before);
}

Vector3 Safety::wallTarget(const Vector3& p_DH) const noexcept {
  const Vector3 wall = wallForce(p_DH, limits_) * softStartFactor(wall_since_, limits_);
  return inRamp() ? clampNorm(wall, std::max(wall_.norm(), startLimit())) : wall;
}

/// The stiffness left beside the scene's spring acts at once; what the wall lacks of its spring's force, or
/// has beyond it, comes and goes by 20 N/s.
Vector3 Safety::limitedBesideScene(const Vector3& wall, double stiffness_left, const Vector3& p_DH,
                                   double growth) noexcept {
  if (!wall_lags_ && stiffness_left >= limits_.wall_stiffness) return wall;
  const double before = wall_.norm();
  const double step = limits_.start_force_slew * growth;
  const double beyond = std::max(wall_distance_, limits_.wall_radius);
  const double moved = std::max(std::min(0.0, p_DH.norm() - wall_distance_), p_DH.norm() - beyond);
  const double followed = before + stiffness_left * moved;
  double force = std::max(0.0, std::clamp(wall.norm(), followed - step, followed + step));
  if (inRamp()) force = std::min(force, std::max(before, startLimit()));
  wall_lags_ = force != wall.norm();
  return wall_lags_ ? Vector3(-force * p_DH.normalized()) : wall;
}

Vector3 Safety::wallBesideScene() const noexcept {
  if (wall_.isZero(0.0)) return Vector3::Zero();
  return wall_ * (1.0 - std::clamp(sceneForce().dot(wall_) / wall_.squaredNorm(), 0.0, 1.0));
}

/// Intensities fade like a force; a hand that is stopped or whose contacts are unknown feels none.
void Safety::fadeTactors(const SafetyRequest& request, DeviceCommand& command) const noexcept {
  const double factor = request.restart ? 0.0 : ageFactor(request.age, limits_);
  for (std::size_t i = 0; i < command.tactors.size(); ++i)
    command.tactors[i] = static_cast<std::uint8_t>(factor * request.requested.tactors[i]);
}

Wrench Safety::limitOutput(const Wrench& wrench, double dt) noexcept {
  const double thermal_limit = heat_.forceLimit(limits_);
  const double force = wrench.force.norm();
  setFlag(SafetyRule::kForceLimited, force > limits_.peak_force || wrench.torque.norm() > limits_.torque);
  setFlag(SafetyRule::kThermal, force > thermal_limit && thermal_limit < limits_.peak_force);
  Wrench limited{clampNorm(wrench.force, thermal_limit), clampNorm(wrench.torque, limits_.torque)};
  if (limits_.force_quantum > 0.0) {
    const Vector3 quantized = quantizeForce(limited.force, limits_.force_quantum);
    setFlag(SafetyRule::kMotorSaturated,
            (limited.force - quantized).cwiseAbs().maxCoeff() > limits_.force_quantum);
    limited.force = quantized;
  }
  heat_.update(limited.force.norm(), dt, limits_);
  return limited;
}

bool Safety::wantsDisarm() const noexcept {
  constexpr std::uint32_t kDisarming =
      bit(SafetyRule::kEmergencyStop) | bit(SafetyRule::kNotArmed) | bit(SafetyRule::kClutchOpen);
  return (flags_ & kDisarming) != 0;
}

void Safety::reset() noexcept {
  stopped_ = false;
  clutch_tripped_ = false;
  if (clutch_) clutch_->open = false;
  braking_ = false;
  startFromZero();
  passivity_.reset();
}

void Safety::updateEpisodes(double requested_force) noexcept {
  for (int i = 0; i < kSafetyRules; ++i) {
    const auto rule = static_cast<SafetyRule>(1U << static_cast<unsigned>(i));
    Episode& episode = episodes_[static_cast<std::size_t>(i)];
    if (acts(rule)) {
      if (!episode.open) openEpisode(episode, rule, requested_force);
      ++episode.active_ticks;
      episode.last = tick_;
    } else if (episode.open && tick_ - episode.last > kEndAfterTicks) {
      episode.open = false;
      if (episode.reported)
        queue({.tick = episode.last, .rule = rule, .began = false, .active_ticks = episode.active_ticks});
    }
  }
}

void Safety::openEpisode(Episode& episode, SafetyRule rule, double requested_force) noexcept {
  episode.open = true;
  episode.active_ticks = 0;
  episode.reported =
      !isRoutine(rule) || episode.reported_at == 0 || tick_ - episode.reported_at >= kReportInterval;
  if (!episode.reported) {
    ++episode.unreported;
    return;
  }
  queue({.tick = tick_,
         .rule = rule,
         .requested_force = requested_force,
         .output_force = output_.force.norm(),
         .unreported = episode.unreported});
  episode.unreported = 0;
  episode.reported_at = tick_;
}

void Safety::queue(const Intervention& intervention) noexcept {
  if (queued_ - taken_ == kRing) {
    ++taken_;
    ++lost_;
  }
  ring_[queued_++ % kRing] = intervention;
}

bool Safety::takeIntervention(Intervention& intervention) noexcept {
  if (taken_ == queued_) return false;
  intervention = ring_[taken_++ % kRing];
  return true;
}

}  // namespace tenon::devices
