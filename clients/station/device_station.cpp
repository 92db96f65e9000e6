#include "clients/station/device_station.h"

#include <algorithm>
#include <utility>

#include "clients/haptic/haptic_hand.h"
#include "clients/simulated_person/people.h"
#include "clients/station/tracked_person.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::station {

namespace {
/// Where the hand `index` starts: at the object that it moves at first, else at a fixed place.
Pose startOf(std::span<const SceneObject> objects, ObjectId moved, std::size_t index) {
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [moved](const SceneObject& object) { return object.object == moved; });
  return Pose(found != objects.end() ? found->X_WO.translation()
                                     : Vector3(index == 1 ? -0.3 : 0.3, -0.35, 1.0));
}

/// An arm of a device, and the hand that it moves.
struct Arm : StationArm {
  std::unique_ptr<haptic::HapticHand> hand;
  bool pressed = false;             // a button that arms was down in the last step
  bool has_copy = false;            // of the scene, the hand
  devices::MotorThermalModel heat;  // when its last hand ended
};
}  // namespace

struct DeviceStation::Parts {
  explicit Parts(const StationOptions& station) : options(station) {}

  StationOptions options;
  StationArms devices;
  std::vector<Arm> arms;
  haptic::SceneCopies copies;  // that no hand has taken
  haptic::ForceModelKind force_model = haptic::ForceModelKind::kManifold;
  std::unique_ptr<haptic::Mover> mover;
  std::vector<haptic::MovedHand> moved;  // of each arm

  std::unique_ptr<TrackedPerson> tracked;  // null: there is no tracker

  /// What displays something and is to be armed: each hand, and the bracelet.
  template <class Do>
  void forEachGuarded(const Do& apply) {
    for (Arm& arm : arms)
      if (arm.hand) apply(static_cast<haptic::GuardedDevice&>(*arm.hand));
    if (tracked && tracked->bracelet() != nullptr) apply(*tracked->bracelet());
  }
  /// Index of the arm whose device paces; arms.size(): none does.
  [[nodiscard]] std::size_t pacer() const {
    const auto paces = [](const Arm& arm) { return arm.device->paces(); };
    return static_cast<std::size_t>(std::find_if(arms.begin(), arms.end(), paces) - arms.begin());
  }
  void giveCopy(Arm& arm) {
    if (!arm.hand || arm.has_copy || copies.empty()) return;
    arm.hand->setCopy(std::move(copies.back()));
    copies.pop_back();
    arm.has_copy = true;
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
  parts_->forEachGuarded([](haptic::GuardedDevice& device) { device.end(); });
}

void DeviceStation::finish(bool disarms) noexcept {
  parts_->forEachGuarded([disarms](haptic::GuardedDevice& device) { device.finish(disarms); });
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
  auto opened = parts_->devices.open(options.devices, options.kind == PersonKind::kNone);
  if (!opened) return opened;
  for (const StationArm& arm : parts_->devices.all()) parts_->arms.push_back({arm, {}});
  const std::size_t arms = parts_->arms.size();
  if (options.hands.empty()) options.hands = defaultHands(options.role, arms);
  const std::size_t bodies = options.tracker.empty() ? 0 : TrackedPerson::kBodies;
  if (options.hands.size() != arms || arms == 0 || arms + bodies > haptic::kMaxStationHands)
    return fail("the devices have " + std::to_string(arms) + " arms for " +
                std::to_string(options.hands.size()) + " hands; expected as many, and " +
                std::to_string(haptic::kMaxStationHands - bodies) + " at most");
  if (options.tracker.empty()) return {};
  auto tracked = TrackedPerson::open(options.tracker, options.tactors, options.tactile, options.person.seed);
  if (!tracked) return fail(tracked.error().what);
  parts_->tracked = std::move(*tracked);
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
  if (parts_->tracked) {
    for (std::string& name : TrackedPerson::handNames()) names.push_back(std::move(name));
  }
  return names;
}

std::vector<HandStiffness> DeviceStation::stiffness() const {
  std::vector<HandStiffness> all;
  for (const Arm& arm : parts_->arms) all.push_back(haptic::stiffnessOf(arm.device->caps()));
  return all;
}

Role DeviceStation::role() const { return parts_->options.role; }

bool DeviceStation::hasArmingButton() const {
  return std::any_of(parts_->arms.begin(), parts_->arms.end(),
                     [](const Arm& arm) { return arm.device->caps().arming != 0; });
}

bool DeviceStation::pressesItself() const { return parts_->mover != nullptr; }

std::vector<haptic::HandDevice> DeviceStation::handDevices() const {
  std::vector<haptic::HandDevice> all;
  for (std::size_t i = 0; i < parts_->arms.size(); ++i) {
    const devices::DeviceCaps& caps = parts_->arms[i].device->caps();
    all.push_back({parts_->options.hands[i], caps.model, caps.serial, caps.workspace_radius});
  }
  return all;
}

void DeviceStation::beginHand(std::size_t index, HandId id) {
  Arm& arm = parts_->arms[index];
  haptic::MovedHand& moved = parts_->moved[index];
  // of an earlier seat, in case this one is without that hand
  if (arm.hand && !id.valid()) arm.hand->end();
  if (arm.hand) arm.heat = arm.hand->heat();
  arm.hand.reset();
  arm.has_copy = false;
  moved.hand = nullptr;
  moved.intent = {};
  moved.X_WStart = startOf(sceneObjects(), handObject(index), index);
  if (!id.valid()) return;
  arm.hand = std::make_unique<haptic::HapticHand>(*arm.device, arm.clutch, arm.heat);
  haptic::HapticHand& hand = *arm.hand;
  parts_->giveCopy(arm);
  hand.setForceModel(parts_->force_model);
  hand.begin(id, client_, moved.X_WStart.translation(), arming().permitsForces());
  if (arming().stopped()) hand.permitForces(false);
  moved.hand = &hand;
  moved.X_WStart = hand.pose();
  // who has held the button all along does not press it
  arm.pressed = (hand.device().buttons & arm.device->caps().arming) != 0;
}

void DeviceStation::begin(std::span<const HandId> hand_ids) {
  const std::size_t arms = parts_->arms.size();
  for (std::size_t i = 0; i < arms; ++i) beginHand(i, hand_ids[i]);
  if (parts_->tracked) parts_->tracked->begin(hand_ids.subspan(arms), client_, arming().permitsForces());
  if (parts_->mover) parts_->mover->begin(sceneObjects(), parts_->moved);
}

void DeviceStation::setCopies(haptic::SceneCopies&& copies) {
  parts_->copies = std::move(copies);
  for (Arm& arm : parts_->arms) parts_->giveCopy(arm);
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
  if (parts_->tracked) parts_->tracked->receive(manifold);
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
  if (parts_->tracked) parts_->tracked->permit(arming().permitsForces());
}

Result<void> DeviceStation::armDevices() {
  Result<void> all;
  parts_->forEachGuarded([&all](haptic::GuardedDevice& device) {
    auto one = device.armDevice();
    if (all && !one) all = std::move(one);
  });
  parts_->forEachGuarded([](haptic::GuardedDevice& device) { device.handBack(); });
  return all;
}

bool DeviceStation::wantsArming() const noexcept {
  bool wants = false;
  parts_->forEachGuarded(
      [&wants](const haptic::GuardedDevice& device) { wants = wants || device.wantsArming(); });
  return wants;
}

std::string DeviceStation::pacedBy() const {
  const std::size_t pacer = parts_->pacer();
  return pacer < parts_->arms.size() ? "the device of hand " + parts_->options.hands[pacer] : "";
}

bool DeviceStation::awaitReading(std::chrono::nanoseconds longest) noexcept {
  const std::size_t pacer = parts_->pacer();
  if (pacer >= parts_->arms.size()) return false;
  const Arm& arm = parts_->arms[pacer];
  // without a hand nobody reads it, and while it is armed it is another thread's
  return arm.hand && !arm.hand->wantsArming() && arm.device->awaitReading(longest);
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
  if (parts_->tracked) parts_->tracked->step(seq, dt_, firstHand(), world_.serverEpoch(), inputs_, states_);
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

const haptic::HapticHand* DeviceStation::firstHand() const noexcept {
  for (const Arm& arm : parts_->arms)
    if (arm.hand) return arm.hand.get();
  return nullptr;
}

const char* DeviceStation::activity() const noexcept {
  return parts_->mover ? parts_->mover->activity() : "moved by its owner";
}

}  // namespace tenon::station
