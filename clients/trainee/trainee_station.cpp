#include "clients/trainee/trainee_station.h"

#include <array>
#include <optional>

#include "clients/haptic/bracelet.h"
#include "clients/haptic/haptic_hand.h"
#include "clients/simulated_person/motor_intent.h"
#include "clients/simulated_person/posture.h"
#include "clients/simulated_person/simulated_trainee.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::trainee {

namespace {
enum HandIndex : std::size_t { kRight, kLeft, kForearm, kHead };
constexpr std::array<const char*, 4> kHandNames{"right", "left", "forearm", "head"};
// Fraction of the device's workspace radius that is used: stays clear of the wall of the safety layer.
constexpr double kWorkspaceFraction = 0.94;

/// Initial position of a hand: that of the first object of `kind`, which the hand moves; `fallback` without
/// one.
Vector3 startOf(std::span<const SceneObject> objects, std::string_view kind, const Vector3& fallback) {
  for (const SceneObject& object : objects) {
    if (object.kind == kind) return object.X_WO.translation();
  }
  return fallback;
}

/// Fills the input of a tracked body part at X_WH; its velocity is a difference quotient over `dt` [s].
void track(DeviceInput& input, std::uint32_t seq, const Pose& X_WH, const haptic::WorldView& world,
           double dt) {
  const Displacement moved = displacement(input.sample.X_WH, X_WH);
  const bool first = !input.active;
  input.sample = {seq, X_WH, first ? Twist{} : Twist{moved.translation / dt, moved.rotation / dt}, 0};
  input.active = true;
  input.server_epoch = world.serverEpoch();
}
}  // namespace

struct TraineeStation::Parts {
  explicit Parts(const TraineeOptions& station) : options(station), posture(1.0), person(station.person) {}

  TraineeOptions options;
  std::unique_ptr<devices::BimanualDevice> arms;
  std::unique_ptr<devices::HapticDevice> tactors;
  devices::ClutchLatch clutch;
  std::array<HandId, kHandNames.size()> ids{};
  std::array<std::optional<haptic::HapticHand>, 2> hands;
  std::array<DeviceInput, kHandNames.size()> tracked{};
  std::optional<haptic::Bracelet> bracelet;
  simulated_person::Posture posture;
  simulated_person::SimulatedTrainee person;
  std::array<simulated_person::MotorIntent, 2> intents;

  devices::HapticDevice& arm(std::size_t hand) {
    const bool right = (hand == kRight) != options.swap_hands;
    return right ? arms->right() : arms->left();
  }
  [[nodiscard]] simulated_person::HandPerception perceive(std::size_t hand) {
    simulated_person::HandPerception perception;
    if (!hands[hand]) return perception;
    haptic::HapticHand& haptic = *hands[hand];
    perception.hand = haptic.id();
    perception.X_WH = haptic.pose();
    perception.F_Ho_W = haptic.state().F_Ho_W;
    if (haptic.local().hasManifold()) {
      perception.object = haptic.local().manifold().object;
      perception.X_HO = haptic.local().manifold().X_HO;
    }
    perception.p_WC = haptic.workspace().centre();
    perception.reach = kWorkspaceFraction * haptic.caps().workspace_radius;
    return perception;
  }
  void moveArm(std::size_t hand, const simulated_person::AssemblyBehavior& behavior) {
    devices::HumanArm* const human_arm = hands[hand] ? devices::simulatedHumanArm(arm(hand)) : nullptr;
    if (human_arm == nullptr) return;
    const haptic::Workspace& workspace = hands[hand]->workspace();
    const Twist& velocity = behavior.intendedVelocity();
    human_arm->setIntent(intents[hand].towards(workspace.toDevice(behavior.intendedPose())),
                         {velocity.linear - workspace.velocity(), velocity.angular});
    human_arm->setContraction(behavior.contraction());
  }
};

TraineeStation::TraineeStation(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

TraineeStation::~TraineeStation() {
  for (auto& hand : parts_->hands) {
    if (hand) hand->end();
  }
}

Result<std::unique_ptr<TraineeStation>> TraineeStation::open(const TraineeOptions& options) {
  auto parts = std::make_unique<Parts>(options);
  auto arms = devices::openBimanualDevice(options.device, options.person.seed);
  if (!arms) return fail(arms.error().what);
  parts->arms = std::move(*arms);
  auto tactors = devices::openDevice(options.tactors, options.person.seed);
  if (!tactors) return fail(tactors.error().what);
  parts->tactors = std::move(*tactors);
  std::unique_ptr<TraineeStation> station(new TraineeStation(std::move(parts)));
  if (options.simulated_person) station->press();  // armed before the session begins
  return station;
}

std::vector<std::string> TraineeStation::handNames() const { return {kHandNames.begin(), kHandNames.end()}; }

void TraineeStation::begin(std::span<const HandId> hand_ids) {
  constexpr std::array<const char*, 2> kinds{"pointer", "tool"};
  const std::array<Vector3, 2> fallback{Vector3(0.3, -0.35, 1.0), Vector3(-0.3, -0.35, 1.0)};
  std::array<Pose, 2> starts;
  for (std::size_t i = 0; i < kHandNames.size(); ++i) {
    parts_->ids[i] = hand_ids[i];
    parts_->tracked[i] = {};
    parts_->tracked[i].hand = hand_ids[i];
    parts_->tracked[i].client = client_;
    if (i > kLeft) continue;
    parts_->hands[i].reset();
    parts_->intents[i].reset();
    starts[i] = Pose(startOf(sceneObjects(), kinds[i], fallback[i]));
    if (!hand_ids[i].valid()) continue;
    haptic::HapticHand& hand = parts_->hands[i].emplace(parts_->arm(i), &parts_->clutch);
    if (!hand.begin(hand_ids[i], client_, starts[i].translation(), arming().permitsForces())) {
      report(haptic::StationEventKind::kDeviceFault, hand_ids[i],
             static_cast<std::uint32_t>(hand.device().fault), 0.0);
    }
    starts[i] = hand.pose();
  }
  parts_->bracelet.reset();
  haptic::Bracelet& bracelet =
      parts_->bracelet.emplace(*parts_->tactors, haptic::TactileOptions{parts_->options.tactile});
  // the session goes on without vibration when the bracelet cannot be armed
  static_cast<void>(bracelet.begin(hand_ids[kForearm], arming().permitsForces()));
  parts_->person.begin(sceneObjects(), starts[kRight], starts[kLeft]);
}

void TraineeStation::manifoldReceived(const HandManifold& manifold) noexcept {
  for (auto& hand : parts_->hands) {
    if (hand && hand->id() == manifold.hand) hand->receive(manifold);
  }
  if (parts_->bracelet) parts_->bracelet->receive(manifold);
}

void TraineeStation::stepChanged() { parts_->person.read(currentStep()); }

void TraineeStation::armingChanged() noexcept {
  for (auto& hand : parts_->hands) {
    if (hand) hand->permitForces(arming().permitsForces());
  }
  if (parts_->bracelet) parts_->bracelet->permit(arming().permitsForces());
}

Result<void> TraineeStation::armDevices() {
  Result<void> all;
  const auto keepFirst = [&all](Result<void> one) {
    if (all && !one) all = std::move(one);
  };
  for (auto& hand : parts_->hands) {
    if (hand) keepFirst(hand->armDevice());
  }
  if (parts_->bracelet) keepFirst(parts_->bracelet->armDevice());
  return all;
}

void TraineeStation::step(std::uint32_t seq) noexcept {
  seq_ = seq;
  inputs_.clear();
  states_.clear();
  if (parts_->options.simulated_person) pressLikeAPerson();
  for (auto& hand : parts_->hands) {
    if (!hand) continue;
    hand->step(seq, world_, dt_);
    report(*hand);
    inputs_.push_back(hand->input());
    states_.push_back(hand->state());
  }
  if (parts_->options.simulated_person) {
    parts_->person.step(parts_->perceive(kRight), parts_->perceive(kLeft), world_, kTickSeconds);
    parts_->moveArm(kRight, parts_->person.right());
    parts_->moveArm(kLeft, parts_->person.left());
  }
  trackBody(seq);
}

void TraineeStation::trackBody(std::uint32_t seq) noexcept {
  const auto& right = parts_->hands[kRight];
  if (!right) return;
  parts_->posture.step(right->pose(), right->input().p_WC, kTickSeconds);
  parts_->bracelet->step(seq, dt_);
  const std::array<Pose, 2> poses{parts_->posture.forearm(), parts_->posture.head()};
  for (std::size_t i = kForearm; i <= kHead; ++i) {
    if (!parts_->ids[i].valid()) continue;
    DeviceInput& input = parts_->tracked[i];
    track(input, seq, poses[i - kForearm], world_, kTickSeconds);
    inputs_.push_back(input);
    HandState state;
    state.hand = parts_->ids[i];
    state.seq = seq;
    state.X_WH = state.X_WO_local = poses[i - kForearm];
    state.p_WC = right->input().p_WC;
    if (i == kForearm) state.tactors = parts_->bracelet->intensities();
    states_.push_back(state);
  }
}

const char* TraineeStation::activity() const noexcept { return parts_->person.activity(); }

}  // namespace tenon::trainee
