#include "clients/haptic/haptic_hand.h"

#include <algorithm>
#include <limits>

#include "devices/safety_rules.h"

namespace tenon::haptic {

namespace {
// Most virtual damping B as a fraction of the device's physical damping b.
constexpr double kDampingFraction = 0.2;  // [-]
// A cycle of no time, or of none that is known, counts as this.
constexpr double kShortestCycle = 1e-6;  // [s]
// A longer one, as of a machine that stood still, counts as this for the age of a device's reading.
constexpr double kLongestCycle = 0.01;  // [s]
// The velocity of a last reading counts less and less within this, once the reading is as old as a gap.
constexpr double kVelocityFades = 0.02;  // [s]
// Gap at which the server reports contact, rounding included.
constexpr float kContactGap = 5e-5F;  // [m]

/// Virtual damping beside a spring of stiffness K: passivity needs b >= K (T / 2 + delay) + |B| (Colgate and
/// Schenkel), so none is left where the device's stiffness is limited by its damping b.
double dampingBeside(double K, double b, const devices::DeviceCaps& caps) {
  const double left = b - K * (0.5 / caps.rate + caps.delay);
  return std::clamp(left, 0.0, kDampingFraction * b);
}

CouplingOptions couplingOf(const devices::DeviceCaps& caps) {
  const HandStiffness stiffness = stiffnessOf(caps);
  CouplingOptions options;
  options.max_stiffness = stiffness.translational;
  options.max_rotational_stiffness = stiffness.rotational;
  options.damping = dampingBeside(stiffness.translational, caps.physical_damping, caps);
  options.rotational_damping = dampingBeside(stiffness.rotational, caps.physical_rotational_damping, caps);
  options.dof_mask = caps.dof_mask;
  return options;
}

FixtureLimits fixtureLimitsOf(const devices::DeviceCaps& caps) {
  const devices::SafetyLimits limits = devices::safetyLimits(caps);
  const bool turns = (caps.dof_mask >> 3U) == kAllDofs >> 3U;
  return {limits.stiffness, turns ? limits.rotational_stiffness : 0.0,
          kDampingFraction * caps.physical_damping, limits.continuous_force, turns ? limits.torque : 0.0};
}

WorkspaceOptions workspaceOf(const devices::DeviceCaps& caps) {
  WorkspaceOptions options;
  options.radius = caps.indexing_radius;
  options.gain = caps.indexing_gain;
  return options;
}

bool serverSeesContact(const HandManifold& manifold) {
  return std::any_of(manifold.contacts.begin(), manifold.contacts.end(),
                     [](const ManifoldContact& contact) { return contact.gap <= kContactGap; });
}
}  // namespace

HandStiffness stiffnessOf(const devices::DeviceCaps& caps) noexcept {
  const devices::SafetyLimits limits = devices::safetyLimits(caps);
  return {limits.stiffness, limits.rotational_stiffness};
}

HapticHand::HapticHand(devices::HapticDevice& device, devices::ClutchLatch* clutch,
                       const devices::MotorThermalModel& heat)
    : GuardedDevice(device, clutch),
      workspace_(workspaceOf(device.caps())),
      coupling_(couplingOf(device.caps())),
      switch_slew_(devices::safetyLimits(device.caps())),
      fixture_(fixtureLimitsOf(device.caps())) {
  safety_.setHeat(heat);
}

void HapticHand::begin(HandId hand, ClientId client, const Vector3& p_WH, bool armed) {
  GuardedDevice::begin(armed, device_state_);
  stopped_ = false;
  finish_time_ = 0.0;
  reading_age_ = 0.0;
  readings_lost_ = false;
  workspace_.setCentre(p_WH - device_state_.X_DH.translation());
  input_ = {};
  input_.hand = hand;
  input_.client = client;
  const Pose X_WH = workspace_.toWorld(device_state_.X_DH);
  input_.sample.X_WH = X_WH;
  state_ = {};
  state_.hand = hand;
  state_.p_WC = workspace_.centre();
  coupling_.reset();
  fixture_.restart();
}

void HapticHand::permitForces(bool permitted) noexcept {
  stopped_ = !permitted;
  if (!permit(permitted, device_state_.forces_on)) return;
  coupling_.reset();
  reading_age_ = 0.0;
  readings_lost_ = false;
}

void HapticHand::step(std::uint32_t seq, const WorldView& world, double dt) noexcept {
  if (!(dt > 0.0)) dt = kShortestCycle;
  if (finishing_) finish_time_ += dt;
  takeScene();
  readDevice(dt);
  answers_.step(seq, local_.hasManifold() ? local_.manifold().answers_seq : 0, dt);
  fresh_ = backoff_.step(excess() <= safety_.limits().fade_from, dt);
  moveWorkspace(dt);
  if (!declutched_) anchor(seq, world);
  const Pose X_WH = workspace_.toWorld(device_state_.X_DH);
  const Twist V_WH{device_state_.V_DH.linear + workspace_.velocity(), device_state_.V_DH.angular};

  if (local_.hasManifold()) time_.receive(local_.manifold(), seq);
  local_.expectAt(time_.known() ? time_.tickOf(seq) : 0.0);
  stepModels(X_WH, world);
  in_contact_ = model().proxy().touching || (local_.hasManifold() && serverSeesContact(local_.manifold()));
  devices::DeviceCommand command = safety_.step(request(X_WH, dt), device_state_, dt);
  if (finished()) command.F_Ho_D = {};  // of the workspace's wall too
  writeDevice(command);
  state_.F_Ho_W = command.F_Ho_D;
  updateOutputs(seq, world, V_WH);
  updateEvents();
  // the device has its force: what the next cycle renders may take the rest of this one
  if (copy_ && wanted_model_ == ForceModelKind::kSceneCopy && local_.hasManifold())
    copy_->compute(local_.manifold(), seq, time_, X_WH, V_WH, world, rendering_ == Rendering::kOn);
}

void HapticHand::stepModels(const Pose& X_WH, const WorldView& world) noexcept {
  local_.step(X_WH, world);
  const bool use_copy = rendersCopy();
  if (use_copy) copy_->step(X_WH, world);
  const ForceModelKind kind = use_copy ? ForceModelKind::kSceneCopy : ForceModelKind::kManifold;
  if (kind == model_kind_) return;
  model_kind_ = kind;
  beyond_count_ = model().beyondValidity();
  coupling_.reset();
  switch_slew_.begin();
}

bool HapticHand::rendersCopy() const noexcept {
  if (!copy_) return false;
  if (rendering_ == Rendering::kOn) return wanted_model_ == ForceModelKind::kSceneCopy && copy_->ready();
  // in a gap the other model's contacts may be those of another place
  const bool ages =
      excess() > safety_.limits().fade_from && local_.proxy().active && !local_.proxy().discontinuous;
  return model_kind_ == ForceModelKind::kSceneCopy && ages;
}

void HapticHand::checkReading(std::uint64_t seq_before, double dt) noexcept {
  const bool is_new = device_state_.seq != seq_before;
  if (is_new) V_DH_read_ = device_state_.V_DH;
  reading_age_ = is_new ? 0.0 : reading_age_ + std::min(dt, kLongestCycle);
  // gradually, since the layer may damp by it
  const double late = reading_age_ - safety_.limits().fade_from;
  const double share = std::clamp(1.0 - late / kVelocityFades, 0.0, 1.0);
  device_state_.V_DH = {share * V_DH_read_.linear, share * V_DH_read_.angular};
  readings_lost_ = readings_lost_ || reading_age_ > safety_.limits().stale_at;
  if (!readings_lost_) return;
  device_state_.forces_on = false;
  if (device_state_.fault == devices::DeviceFault::kNone)
    device_state_.fault = devices::DeviceFault::kCommunication;
}

void HapticHand::readDevice(double dt) noexcept {
  if (!handover_.pending()) {
    const std::uint64_t seq_before = device_state_.seq;
    device_.read(device_state_);
    return checkReading(seq_before, dt);
  }
  device_state_.forces_on = false;
  device_state_.V_DH = {};
  // the person has looked at it: what it said before does not latch the clutch again
  device_state_.fault = devices::DeviceFault::kNone;
  device_state_.F_Ho_D_measured = {};
}

void HapticHand::moveWorkspace(double dt) noexcept {
  const Vector3& p_DH = device_state_.X_DH.translation();
  declutched_ = (device_state_.buttons & device_.caps().declutch) != 0;
  if (declutched_) {
    rendering_ = Rendering::kInterrupted;
    return workspace_.stepDeclutched(input_.sample.X_WH.translation(), p_DH, device_state_.V_DH.linear);
  }
  // a device without forces may rest at the end of its workspace, where indexing would not end
  const bool hold =
      in_contact_ || !permitted_ || !device_state_.forces_on || rendering_ == Rendering::kAnchoring;
  workspace_.step(p_DH, hold, dt);
}

bool HapticHand::deadManHeld() const noexcept {
  const std::uint32_t switches = device_.caps().dead_man;
  return switches == 0 || (device_state_.buttons & switches) != 0;
}

void HapticHand::anchor(std::uint32_t seq, const WorldView& world) noexcept {
  if (answers_.isTooLong()) {
    const bool permitted = reading_age_ <= safety_.limits().fade_from && permitted_ && safety_.forcesOn() &&
                           local_.usable(world);
    // one interrupted cycle first: by that the contact force leaves within 20 ms
    const bool is_out = rendering_ == Rendering::kInterrupted || rendering_ == Rendering::kGuidanceAlone;
    rendering_ = permitted && is_out ? Rendering::kGuidanceAlone : Rendering::kInterrupted;
    return;
  }
  if (rendering_ == Rendering::kGuidanceAlone) rendering_ = Rendering::kInterrupted;
  const bool usable = fresh_ && permitted_ && safety_.forcesOn() && local_.usable(world);
  const bool jumped = local_.jumped() || model().jumped();
  if (!usable || (jumped && rendering_ == Rendering::kOn)) rendering_ = Rendering::kInterrupted;
  if (!usable || rendering_ == Rendering::kOn) return;

  const Pose X_WH = workspace_.toWorld(device_state_.X_DH);
  workspace_.shift(local_.serverProxy().translation() - X_WH.translation());
  local_.restart();
  if (rendering_ == Rendering::kInterrupted) {
    rendering_ = Rendering::kAnchoring;
    anchored_seq_ = seq;
  } else if (static_cast<std::int32_t>(answers_.answered() - anchored_seq_) >= 0) {
    rendering_ = Rendering::kOn;
  }
}

devices::SafetyRequest HapticHand::request(const Pose& X_WH, double dt) noexcept {
  const LocalProxy& proxy = model().proxy();
  const double age = excess();
  const bool guides_alone = rendering_ == Rendering::kGuidanceAlone;
  const bool renders = rendering_ == Rendering::kOn || guides_alone;
  devices::SafetyRequest request;
  request.requested.F_Ho_D = fixture_.step(X_WH, dt, renders && !finishing_);
  request.stiffness = fixture_.stiffness();
  request.rotational_stiffness = fixture_.rotationalStiffness();
  if (guides_alone) {
    coupling_.reset();
    request.age = reading_age_;
  } else {  // springs in parallel
    const Wrench F_Ho_W = switch_slew_.step(coupling_.step(proxy, X_WH, dt), dt);
    request.requested.F_Ho_D = F_Ho_W + request.requested.F_Ho_D;
    request.stiffness += coupling_.stiffness();
    request.rotational_stiffness += coupling_.rotationalStiffness();
    // without contacts to render there is no force that could be old
    request.age = proxy.active ? age : reading_age_;
  }
  // while they only get older the force fades; after a jump, and once they are fresh again, it is another one
  request.restart = finishing_ || (!renders && (!proxy.active || proxy.discontinuous ||
                                                answers_.isTooLong() || age <= safety_.limits().fade_from));
  request.dead_man_held = deadManHeld();
  if (request.restart || !request.dead_man_held || !safety_.forcesOn()) {
    fixture_.restart();
    switch_slew_.reset();
  }
  request.armed = permitted_ || stopped_;
  request.emergency_stop = stopped_;
  return request;
}

void HapticHand::writeDevice(const devices::DeviceCommand& command) noexcept {
  if (handover_.pending()) return;
  const LocalProxy& proxy = model().proxy();
  device_.show({proxy.active, in_contact_, workspace_.toDevice(proxy.X_WS), workspace_.toDevice(proxy.X_WO),
                workspace_.centre(), local_.hasManifold() ? local_.manifold().object : ObjectId{}});
  write(command, finished());
}

/// The last sample becomes the first of the earlier ones of input `seq`.
void HapticHand::keepSample(std::uint32_t seq) noexcept {
  auto& earlier = input_.earlier;
  if (input_.sample.seq == 0 || seq != input_.sample.seq + 1) return earlier.clear();
  earlier.resize(std::min(earlier.size() + 1, earlier.capacity()));
  for (std::size_t i = earlier.size() - 1; i > 0; --i) earlier[i] = earlier[i - 1];
  earlier[0] = input_.sample;
}

void HapticHand::updateOutputs(std::uint32_t seq, const WorldView& world, const Twist& V_WH) noexcept {
  const LocalProxy& proxy = model().proxy();
  keepSample(seq);
  input_.sample = {seq, workspace_.toWorld(device_state_.X_DH), V_WH, device_state_.buttons};
  input_.server_epoch = world.serverEpoch();
  input_.active = permitted_ && deadManHeld() && !handover_.pending() && !safety_.wantsDisarm() &&
                  device_state_.fault == devices::DeviceFault::kNone;

  state_.seq = seq;
  state_.X_WH = input_.sample.X_WH;
  state_.p_WC = workspace_.centre();
  state_.X_WO_local = proxy.X_WO;
  const double age = answers_.age() / kTickSeconds;
  constexpr double kUnknown = std::numeric_limits<std::uint32_t>::max();
  state_.manifold_age = static_cast<std::uint32_t>(std::min(age, kUnknown));
  state_.safety_flags = safety_.flags();
  state_.guidance_force = static_cast<float>(fixture_.force());
}

void HapticHand::updateEvents() noexcept {
  events_ = {};
  // interventions beyond the capacity follow in the next step
  devices::Intervention intervention;
  while (!events_.interventions.full() && safety_.takeIntervention(intervention))
    events_.interventions.push_back(intervention);
  const bool fault = device_state_.fault != devices::DeviceFault::kNone;
  events_.fault_began = fault && !fault_;
  fault_ = fault;
  events_.indexing_began = workspace_.moving() && !state_.indexing;
  events_.indexing_ended = !workspace_.moving() && state_.indexing;
  state_.indexing = workspace_.moving();
  const bool beyond = model().beyondValidity() != beyond_count_;
  beyond_count_ = model().beyondValidity();
  events_.beyond_validity_began = beyond && !beyond_validity_;
  beyond_validity_ = beyond;
  const bool stale =
      local_.hasManifold() && answers_.excess() > safety_.limits().fade_from && !answers_.isTooLong();
  events_.stale_began = stale && !stale_;
  stale_ = stale;
  events_.guidance_alone_began = answers_.isTooLong() && !guidance_alone_;
  events_.guidance_alone_ended = !answers_.isTooLong() && guidance_alone_;
  guidance_alone_ = answers_.isTooLong();
  events_.guidance_began = fixture_.acts() && !guided_;
  events_.guidance_ended = !fixture_.acts() && guided_;
  guided_ = fixture_.acts();
}

}  // namespace tenon::haptic
