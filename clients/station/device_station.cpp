#include "clients/station/device_station.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "clients/haptic/bracelet.h"
#include "clients/haptic/haptic_hand.h"
#include "clients/simulated_person/people.h"
#include "clients/simulated_person/posture.h"
#include "clients/station/tracked_input.h"
#include "devices/mounted_device.h"
#include "devices/simulated/body_tracker.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::station {

namespace {
using devices::TrackedBody;

struct TrackedHand {
  TrackedBody body;
  const char* name;  // of its hand
};
constexpr std::array kTracked{TrackedHand{TrackedBody::kForearm, "forearm"},
                              TrackedHand{TrackedBody::kHead, "head"}};

/// Where the hand `index` starts: at the object that it moves at first, else at a fixed place.
Pose startOf(std::span<const SceneObject> objects, ObjectId moved, std::size_t index) {
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [moved](const SceneObject& object) { return object.object == moved; });
  return Pose(found != objects.end() ? found->X_WO.translation()
                                     : Vector3(index == 1 ? -0.3 : 0.3, -0.35, 1.0));
}

// [ticks] of a body part's inputs: it feels vibrations, and moves nothing that a hand holds
constexpr std::uint8_t kTrackedPeriod = 4;

/// A device of the catalog; its arms share a clutch.
struct OpenDevice {
  std::unique_ptr<devices::HapticDevice> one;
  std::unique_ptr<devices::BimanualDevice> pair;
  std::unique_ptr<devices::ClutchLatch> clutch = std::make_unique<devices::ClutchLatch>();
};

/// An arm of a device, and the hand that it moves.
struct Arm {
  devices::HapticDevice* device = nullptr;
  devices::ClutchLatch* clutch = nullptr;
  Quaternion q_DM;  // of its mounting
  std::unique_ptr<haptic::HapticHand> hand;
  bool pressed = false;  // a button that arms was down in the last step
};
}  // namespace

struct DeviceStation::Parts {
  explicit Parts(const StationOptions& station) : options(station) {}

  StationOptions options;
  std::vector<OpenDevice> devices;
  std::vector<Arm> arms;
  std::shared_ptr<const simulation::Scene> scene;  // of the force model `scene copy`; null: not there
  haptic::ForceModelKind force_model = haptic::ForceModelKind::kManifold;
  std::unique_ptr<haptic::Mover> mover;
  std::vector<haptic::MovedHand> moved;  // of each arm

  std::unique_ptr<devices::Tracker> tracker;
  std::unique_ptr<devices::HapticDevice> tactors;
  std::array<DeviceInput, kTracked.size()> tracked{};
  std::optional<haptic::Bracelet> bracelet;
  simulated_person::Posture posture{1.0};

  void addDevice(OpenDevice device, const Quaternion& q_DM) {
    devices::ClutchLatch* const clutch = device.clutch.get();
    const auto add = [&](devices::HapticDevice& arm) { arms.push_back({&arm, clutch, q_DM, {}, false}); };
    if (device.pair) {
      add(device.pair->right());
      add(device.pair->left());
    } else {
      add(*device.one);
    }
    devices.push_back(std::move(device));
  }
  [[nodiscard]] bool faulty() const {
    for (const Arm& arm : arms) {
      if (arm.hand && arm.hand->faulty()) return true;
    }
    return false;
  }
};

StationOptions defaultStation(Role role, const simulated_person::PersonOptions& person) {
  StationOptions options;
  options.role = role;
  options.person = person;
  const bool trainee = role == Role::kTrainee;
  options.devices.push_back(
      {std::string(trainee ? devices::kTraineeDevice : devices::kInstructorDevice), {}});
  options.devices.front().configuration.seed = person.seed;
  if (!trainee) return options;
  options.tracker = devices::kBodyTracker;
  options.tactors = devices::kBracelet;
  return options;
}

std::vector<std::string> defaultHands(Role role, std::size_t arms) {
  std::vector<std::string> hands{"right", "left"};
  if (role == Role::kInstructor) hands = {"instructor", "instructor_left"};
  hands.resize(std::min(hands.size(), arms));
  return hands;
}

DeviceStation::DeviceStation(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

DeviceStation::~DeviceStation() { end(); }

void DeviceStation::end() noexcept {
  for (Arm& arm : parts_->arms) {
    if (arm.hand) arm.hand->end();
  }
  if (parts_->bracelet) parts_->bracelet->end();
}

void DeviceStation::finish(bool disarms) noexcept {
  for (Arm& arm : parts_->arms) {
    if (arm.hand) arm.hand->finish(disarms);
  }
  if (parts_->bracelet) parts_->bracelet->finish(disarms);
}

/// The bracelet is silent after one step.
bool DeviceStation::finished() const noexcept {
  const auto done = [](const Arm& arm) { return !arm.hand || arm.hand->finished(); };
  return std::all_of(parts_->arms.begin(), parts_->arms.end(), done);
}

Result<std::unique_ptr<DeviceStation>> DeviceStation::open(const StationOptions& options) {
  std::unique_ptr<DeviceStation> station(new DeviceStation(std::make_unique<Parts>(options)));
  if (auto opened = station->openDevices(); !opened) return fail(opened.error().what);
  station->makeMover();
  if (options.kind != PersonKind::kNone) station->press();  // armed before the session begins
  return station;
}

Result<void> DeviceStation::openDevices() {
  StationOptions& options = parts_->options;
  for (const StationDevice& device : options.devices) {
    if (device.opened) {
      OpenDevice open;
      open.one = std::make_unique<devices::MountedDevice>(*device.opened, device.configuration.q_DM);
      parts_->addDevice(std::move(open), device.configuration.q_DM);
      continue;
    }
    const auto facts = devices::findDevice(device.name);
    if (!facts) return fail(facts.error().what);
    if (facts->arms == 0) return fail("device '" + device.name + "' moves no hand");
    if (!facts->simulated && options.kind != PersonKind::kNone)
      return fail("device '" + device.name + "' is moved by its owner: expected --person none with it");
    OpenDevice open;
    if (facts->arms == 2) {
      auto pair = devices::openBimanualDevice(device.name, device.configuration);
      if (!pair) return fail(pair.error().what);
      open.pair = std::move(*pair);
    } else {
      auto one = devices::openDevice(device.name, device.configuration);
      if (!one) return fail(one.error().what);
      open.one = std::move(*one);
    }
    parts_->addDevice(std::move(open), device.configuration.q_DM);
  }
  const std::size_t arms = parts_->arms.size();
  if (options.hands.empty()) options.hands = defaultHands(options.role, arms);
  const std::size_t bodies = options.tracker.empty() ? 0 : kTracked.size();
  if (options.hands.size() != arms || arms == 0 || arms + bodies > haptic::kMaxStationHands)
    return fail("the devices have " + std::to_string(arms) + " arms for " +
                std::to_string(options.hands.size()) + " hands; expected as many, and " +
                std::to_string(haptic::kMaxStationHands - bodies) + " at most");
  if (!options.tracker.empty()) {
    auto tracker = devices::openTracker(options.tracker, {.seed = options.person.seed});
    if (!tracker) return fail(tracker.error().what);
    parts_->tracker = std::move(*tracker);
  }
  if (options.tactors.empty()) return {};
  auto tactors = devices::openDevice(options.tactors, {.seed = options.person.seed});
  if (!tactors) return fail(tactors.error().what);
  parts_->tactors = std::move(*tactors);
  return {};
}

void DeviceStation::makeMover() {
  const StationOptions& options = parts_->options;
  if (options.kind == PersonKind::kScript) {
    parts_->mover = std::make_unique<ScriptMover>(options.scripts);
  } else if (options.kind == PersonKind::kSimulated) {
    parts_->mover = options.role == Role::kInstructor ? simulated_person::makeInstructor(options.person)
                                                      : simulated_person::makeTrainee(options.person);
  }
  for (const std::string& hand : options.hands) parts_->moved.push_back({.name = hand});
}

std::vector<std::string> DeviceStation::handNames() const {
  std::vector<std::string> names = parts_->options.hands;
  if (parts_->tracker) {
    for (const TrackedHand& tracked : kTracked) names.emplace_back(tracked.name);
  }
  return names;
}

std::vector<HandStiffness> DeviceStation::stiffness() const {
  std::vector<HandStiffness> all;
  for (const Arm& arm : parts_->arms) all.push_back(haptic::stiffnessOf(arm.device->caps()));
  return all;
}

Role DeviceStation::role() const { return parts_->options.role; }

std::vector<haptic::HandDevice> DeviceStation::handDevices() const {
  std::vector<haptic::HandDevice> all;
  for (std::size_t i = 0; i < parts_->arms.size(); ++i) {
    const devices::DeviceCaps& caps = parts_->arms[i].device->caps();
    all.push_back({parts_->options.hands[i], caps.model, caps.workspace_radius});
  }
  return all;
}

void DeviceStation::beginHand(std::size_t index, HandId id) {
  Arm& arm = parts_->arms[index];
  haptic::MovedHand& moved = parts_->moved[index];
  // of an earlier seat, in case this one is without that hand
  if (arm.hand && !id.valid()) arm.hand->end();
  arm.hand.reset();
  moved.hand = nullptr;
  moved.intent = {};
  moved.X_WStart = startOf(sceneObjects(), handObject(index), index);
  if (!id.valid()) return;
  arm.hand = std::make_unique<haptic::HapticHand>(*arm.device, arm.clutch);
  haptic::HapticHand& hand = *arm.hand;
  hand.setScene(parts_->scene);
  hand.setForceModel(parts_->force_model);
  hand.begin(id, client_, moved.X_WStart.translation(), arming().permitsForces());
  moved.hand = &hand;
  moved.X_WStart = hand.pose();
  // who has held the button all along does not press it
  arm.pressed = (hand.device().buttons & arm.device->caps().arming) != 0;
}

void DeviceStation::begin(std::span<const HandId> hand_ids) {
  const std::size_t arms = parts_->arms.size();
  for (std::size_t i = 0; i < arms; ++i) beginHand(i, hand_ids[i]);
  for (std::size_t i = 0; parts_->tracker && i < kTracked.size(); ++i) {
    parts_->tracked[i] = {};
    parts_->tracked[i].hand = hand_ids[arms + i];
    parts_->tracked[i].client = client_;
  }
  parts_->bracelet.reset();
  if (parts_->tracker && parts_->tactors) {
    haptic::Bracelet& bracelet =
        parts_->bracelet.emplace(*parts_->tactors, haptic::TactileOptions{parts_->options.tactile});
    // the session continues without vibration when the bracelet cannot be armed
    bracelet.begin(hand_ids[arms], arming().permitsForces());
  }
  if (parts_->mover) parts_->mover->begin(sceneObjects(), parts_->moved);
}

void DeviceStation::setScene(const std::shared_ptr<const simulation::Scene>& scene) {
  parts_->scene = scene;
  for (Arm& arm : parts_->arms)
    if (arm.hand) arm.hand->setScene(scene);
}

haptic::ForceModelKind DeviceStation::forceModel() const noexcept { return parts_->force_model; }

void DeviceStation::setForceModel(haptic::ForceModelKind kind) noexcept {
  parts_->force_model = kind;
  for (Arm& arm : parts_->arms)
    if (arm.hand) arm.hand->setForceModel(kind);
}

void DeviceStation::receive(const CollisionMatrix& matrix) noexcept {
  for (Arm& arm : parts_->arms)
    if (arm.hand) arm.hand->receive(matrix);
}

void DeviceStation::manifoldReceived(const HandManifold& manifold) noexcept {
  for (Arm& arm : parts_->arms) {
    if (arm.hand && arm.hand->id() == manifold.hand) arm.hand->receive(manifold);
  }
  if (parts_->bracelet) parts_->bracelet->receive(manifold);
}

void DeviceStation::guidanceReceived(const Guidance& guidance) noexcept {
  for (Arm& arm : parts_->arms) {
    if (arm.hand && arm.hand->id() == guidance.hand) arm.hand->receive(guidance);
  }
}

void DeviceStation::stepChanged() {
  if (parts_->mover) parts_->mover->read(currentStep());
}

void DeviceStation::armingChanged() noexcept {
  for (Arm& arm : parts_->arms) {
    if (arm.hand) arm.hand->permitForces(arming().permitsForces());
  }
  if (parts_->bracelet) parts_->bracelet->permit(arming().permitsForces());
}

Result<void> DeviceStation::armDevices() {
  Result<void> all;
  const auto keepFirst = [&all](Result<void> one) {
    if (all && !one) all = std::move(one);
  };
  for (Arm& arm : parts_->arms) {
    if (arm.hand) keepFirst(arm.hand->armDevice());
  }
  if (parts_->bracelet) keepFirst(parts_->bracelet->armDevice());
  for (Arm& arm : parts_->arms) {
    if (arm.hand) arm.hand->handBack();
  }
  if (parts_->bracelet) parts_->bracelet->handBack();
  return all;
}

bool DeviceStation::wantsArming() const noexcept {
  const auto wants = [](const Arm& arm) { return arm.hand && arm.hand->wantsArming(); };
  return std::any_of(parts_->arms.begin(), parts_->arms.end(), wants) ||
         (parts_->bracelet && parts_->bracelet->wantsArming());
}

void DeviceStation::step(std::uint32_t seq) noexcept {
  seq_ = seq;
  inputs_.clear();
  states_.clear();
  pressButtons();
  for (Arm& arm : parts_->arms) {
    if (!arm.hand) continue;
    arm.hand->setLinkJitter(link_jitter_);
    arm.hand->setLinkRoundTrip(link_round_trip_);
    arm.hand->step(seq, world_, dt_);
    report(*arm.hand);
    inputs_.push_back(arm.hand->input());
    states_.push_back(arm.hand->state());
  }
  if (parts_->mover) moveArms();
  if (parts_->tracker) trackBody(seq);
}

void DeviceStation::pressButtons() noexcept {
  if (parts_->mover) pressLikeAPerson(parts_->faulty());
  for (Arm& arm : parts_->arms) {
    if (!arm.hand) continue;
    const bool down = (arm.hand->device().buttons & arm.device->caps().arming) != 0;
    if (down && !arm.pressed) press();
    arm.pressed = down;
  }
}

void DeviceStation::moveArms() noexcept {
  parts_->mover->step(parts_->moved, world_);
  for (std::size_t i = 0; i < parts_->arms.size(); ++i) {
    const Arm& arm = parts_->arms[i];
    devices::HumanArm* const human_arm = arm.hand ? devices::simulatedHumanArm(*arm.device) : nullptr;
    if (human_arm == nullptr) continue;
    const haptic::ArmIntent& intent = parts_->moved[i].intent;
    const Quaternion q_MD = arm.q_DM.conjugate();
    human_arm->setIntent(Pose(q_MD * intent.X_DI.translation(), q_MD * intent.X_DI.rotation() * arm.q_DM),
                         {q_MD * intent.V_DI.linear, q_MD * intent.V_DI.angular});
    human_arm->setContraction(intent.contraction);
    human_arm->setButtons(intent.buttons | arm.device->caps().dead_man);
  }
}

void DeviceStation::trackBody(std::uint32_t seq) noexcept {
  const auto& arms = parts_->arms;
  const auto wears = [](const Arm& arm) { return arm.hand != nullptr; };
  const auto wearing_arm = std::find_if(arms.begin(), arms.end(), wears);
  const haptic::HapticHand* const wearer = wearing_arm == arms.end() ? nullptr : wearing_arm->hand.get();
  devices::BodyTracker* const simulated = devices::simulatedBodyTracker(*parts_->tracker);
  if (simulated != nullptr && wearer != nullptr) {
    parts_->posture.step(wearer->pose(), wearer->state().p_WC, kTickSeconds);
    simulated->place(TrackedBody::kForearm, parts_->posture.forearm());
    simulated->place(TrackedBody::kHead, parts_->posture.head());
  }
  if (parts_->bracelet) parts_->bracelet->step(seq, dt_);
  for (std::size_t i = 0; i < kTracked.size(); ++i) {
    DeviceInput& input = parts_->tracked[i];
    devices::TrackerReading reading;
    parts_->tracker->read(kTracked[i].body, reading);
    if (!input.hand.valid()) continue;
    if (reading.visible) {
      setTrackedPose(input, reading.X_TB, kTickSeconds);
    } else {
      input.active = false;
      input.sample.V_WH = {};
    }
    input.sample.seq = seq;
    input.period = kTrackedPeriod;
    input.server_epoch = world_.serverEpoch();
    inputs_.push_back(input);
    HandState state;
    state.hand = input.hand;
    state.seq = seq;
    state.X_WH = state.X_WO_local = input.sample.X_WH;
    if (wearer != nullptr) state.p_WC = wearer->state().p_WC;
    if (kTracked[i].body == TrackedBody::kForearm && parts_->bracelet)
      state.tactors = parts_->bracelet->intensities();
    states_.push_back(state);
  }
}

const char* DeviceStation::activity() const noexcept {
  return parts_->mover ? parts_->mover->activity() : "moved by its owner";
}

}  // namespace tenon::station
