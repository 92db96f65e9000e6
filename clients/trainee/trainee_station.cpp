#include "clients/trainee/trainee_station.h"

#include <array>
#include <optional>

#include "clients/haptic/haptic_hand.h"
#include "clients/trainee/posture.h"
#include "clients/trainee/simulated_trainee.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"

namespace tenon {

namespace {
enum HandIndex : std::size_t { kRight, kLeft, kForearm, kHead };
constexpr std::array<const char*, 4> kHandNames{"right", "left", "forearm", "head"};
// Short of the safety layer's wall, which is nothing to work against.
constexpr double kComfortableReach = 0.94;

/// Where a hand begins: where the thing stands that it moves.
Vector3 startOf(std::span<const SceneObject> objects, std::string_view kind, const Vector3& otherwise) {
  for (const SceneObject& object : objects) {
    if (object.kind == kind) return object.X_WO.translation();
  }
  return otherwise;
}

void track(DeviceInput& input, std::uint32_t seq, const Pose& X_WH, const WorldView& world, double dt) {
  for (std::size_t i = input.samples.size() - 1; i > 0; --i) input.samples[i] = input.samples[i - 1];
  const Displacement moved = displacement(input.samples[1].X_WH, X_WH);
  const bool first = !input.active;
  input.samples[0] = {seq, X_WH, first ? Twist{} : Twist{moved.translation / dt, moved.rotation / dt}, 0};
  if (first) input.samples.fill(input.samples[0]);
  input.active = true;
  input.server_epoch = world.serverEpoch();
  input.heard_tick = world.tick();
}
}  // namespace

struct TraineeStation::Parts {
  explicit Parts(const TraineeOptions& station)
      : options(station), tactile({station.tactile}), posture(1.0), person(station.person) {}

  TraineeOptions options;
  std::unique_ptr<DevicePair> arms;
  std::unique_ptr<HapticDevice> band;
  ClutchLatch clutch;
  std::array<HandId, kHandNames.size()> ids{};
  std::array<std::optional<HapticHand>, 2> hands;
  std::array<DeviceInput, kHandNames.size()> tracked{};
  HandManifold forearm_contacts;
  TactileMap tactile;
  Posture posture;
  SimulatedTrainee person;

  HapticDevice& arm(std::size_t hand) {
    const bool right = (hand == kRight) != options.swap_hands;
    return right ? arms->right() : arms->left();
  }
  [[nodiscard]] HandSense sense(std::size_t hand) {
    HandSense sense;
    if (!hands[hand]) return sense;
    HapticHand& haptic = *hands[hand];
    sense.hand = haptic.id();
    sense.X_WH = haptic.pose();
    sense.F_Ho_W = haptic.state().F_Ho_W;
    if (haptic.local().heard()) {
      sense.object = haptic.local().manifold().object;
      sense.X_HO = haptic.local().manifold().X_HO;
    }
    sense.p_WC = haptic.workspace().centre();
    sense.reach = kComfortableReach * haptic.caps().workspace_radius;
    return sense;
  }
  void moveArm(std::size_t hand, const AssemblySkill& skill) {
    HumanArm* const flesh = hands[hand] ? handOf(arm(hand)) : nullptr;
    if (flesh == nullptr) return;
    const Workspace& workspace = hands[hand]->workspace();
    const Twist& wanted = skill.intentVelocity();
    flesh->intend(workspace.toDevice(skill.intent()), {wanted.linear - workspace.velocity(), wanted.angular});
    flesh->stiffen(skill.contraction());
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
  auto arms = openPair(options.device, options.person.seed);
  if (!arms) return fail(arms.error().what);
  parts->arms = std::move(*arms);
  auto band = openDevice(options.tactors, options.person.seed);
  if (!band) return fail(band.error().what);
  parts->band = std::move(*band);
  return std::unique_ptr<TraineeStation>(new TraineeStation(std::move(parts)));
}

std::vector<std::string> TraineeStation::handNames() const { return {kHandNames.begin(), kHandNames.end()}; }

void TraineeStation::begin(std::span<const HandId> hand_ids) {
  constexpr std::array<const char*, 2> kinds{"pointer", "tool"};
  const std::array<Vector3, 2> otherwise{Vector3(0.3, -0.35, 1.0), Vector3(-0.3, -0.35, 1.0)};
  std::array<Pose, 2> starts;
  for (std::size_t i = 0; i < kHandNames.size(); ++i) {
    parts_->ids[i] = hand_ids[i];
    parts_->tracked[i] = {};
    parts_->tracked[i].hand = hand_ids[i];
    parts_->tracked[i].client = client_;
    if (i > kLeft) continue;
    parts_->hands[i].reset();
    starts[i] = Pose(startOf(sceneObjects(), kinds[i], otherwise[i]));
    if (!hand_ids[i].valid()) continue;
    HapticHand& hand = parts_->hands[i].emplace(parts_->arm(i), &parts_->clutch);
    if (!hand.begin(hand_ids[i], client_, starts[i].translation())) {
      report(StationEventKind::kDeviceFault, hand_ids[i], static_cast<std::uint32_t>(hand.device().fault),
             0.0);
    }
    starts[i] = hand.pose();
  }
  // a band that does not vibrate hinders nobody
  static_cast<void>(parts_->band->arm());
  parts_->person.begin(sceneObjects(), starts[kRight], starts[kLeft]);
}

void TraineeStation::heard(const HandManifold& manifold) noexcept {
  for (auto& hand : parts_->hands) {
    if (hand && hand->id() == manifold.hand) hand->receive(manifold);
  }
  if (manifold.hand == parts_->ids[kForearm] && manifold.tick >= parts_->forearm_contacts.tick) {
    parts_->forearm_contacts = manifold;
  }
}

void TraineeStation::stepChanged() { parts_->person.read(currentStep()); }

void TraineeStation::stopChanged(bool engaged) {
  for (auto& hand : parts_->hands) {
    if (hand) hand->stop(engaged);
  }
}

void TraineeStation::step(std::uint32_t seq) noexcept {
  constexpr double dt = kTickSeconds;
  seq_ = seq;
  inputs_.clear();
  states_.clear();
  for (auto& hand : parts_->hands) {
    if (!hand) continue;
    hand->step(seq, world_, dt);
    report(*hand);
    inputs_.push_back(hand->input());
    states_.push_back(hand->state());
  }
  if (parts_->options.simulated_person) {
    parts_->person.step(parts_->sense(kRight), parts_->sense(kLeft), world_, dt);
    parts_->moveArm(kRight, parts_->person.right());
    parts_->moveArm(kLeft, parts_->person.left());
  }
  trackBody(seq, dt);
}

void TraineeStation::trackBody(std::uint32_t seq, double dt) noexcept {
  const auto& right = parts_->hands[kRight];
  if (!right) return;
  parts_->posture.step(right->pose(), right->input().p_WC, dt);

  DeviceState band_state;
  parts_->band->read(band_state);
  DeviceCommand vibration;
  vibration.tactors = parts_->tactile.step(parts_->forearm_contacts, dt);
  parts_->band->write(vibration);
  const std::array<Pose, 2> poses{parts_->posture.forearm(), parts_->posture.head()};
  for (std::size_t i = kForearm; i <= kHead; ++i) {
    if (!parts_->ids[i].valid()) continue;
    DeviceInput& input = parts_->tracked[i];
    track(input, seq, poses[i - kForearm], world_, dt);
    inputs_.push_back(input);
    HandState state;
    state.hand = parts_->ids[i];
    state.seq = seq;
    state.X_WH = state.X_WO_local = poses[i - kForearm];
    state.p_WC = right->input().p_WC;
    if (i == kForearm) state.tactors = vibration.tactors;
    states_.push_back(state);
  }
}

const char* TraineeStation::doing() const noexcept { return parts_->person.doing(); }

}  // namespace tenon
