#include "clients/instructor/instructor_station.h"

#include <optional>

#include "clients/haptic/haptic_hand.h"
#include "clients/instructor/simulated_instructor.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"

namespace tenon {

namespace {
// Short of the safety layer's wall, which is nothing to work against.
constexpr double kComfortableReach = 0.9;
}  // namespace

struct InstructorStation::Parts {
  explicit Parts(const InstructorOptions& station) : options(station), person(station.person) {}

  InstructorOptions options;
  std::unique_ptr<HapticDevice> device;
  std::optional<HapticHand> hand;
  SimulatedInstructor person;

  void movePerson(const WorldView& world, double dt) {
    HumanArm* const flesh = handOf(*device);
    if (flesh == nullptr) return;
    HandSense sense;
    sense.hand = hand->id();
    sense.X_WH = hand->pose();
    sense.F_Ho_W = hand->state().F_Ho_W;
    if (hand->local().heard()) {
      sense.object = hand->local().manifold().object;
      sense.X_HO = hand->local().manifold().X_HO;
    }
    Workspace& workspace = hand->workspace();
    sense.p_WC = workspace.centre();
    sense.reach = kComfortableReach * hand->caps().workspace_radius;
    person.step(sense, workspace, world, dt);
    flesh->intend(workspace.toDevice(person.intent()));
    flesh->stiffen(person.contraction());
  }
};

InstructorStation::InstructorStation(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

InstructorStation::~InstructorStation() {
  if (parts_->hand) parts_->hand->end();
}

Result<std::unique_ptr<InstructorStation>> InstructorStation::open(const InstructorOptions& options) {
  auto parts = std::make_unique<Parts>(options);
  auto device = openDevice(options.device, options.person.seed);
  if (!device) return fail(device.error().what);
  parts->device = std::move(*device);
  return std::unique_ptr<InstructorStation>(new InstructorStation(std::move(parts)));
}

std::vector<std::string> InstructorStation::handNames() const { return {"instructor"}; }

void InstructorStation::begin(std::span<const HandId> hand_ids) {
  parts_->hand.reset();
  Vector3 start(-0.1, -0.3, 1.25);
  for (const SceneObject& object : sceneObjects()) {
    if (object.kind == "assistant") start = object.X_WO.translation();
  }
  Pose X_WStart(start);
  if (hand_ids[0].valid()) {
    HapticHand& hand = parts_->hand.emplace(*parts_->device);
    if (!hand.begin(hand_ids[0], client_, start)) {
      report(StationEventKind::kDeviceFault, hand_ids[0], static_cast<std::uint32_t>(hand.device().fault),
             0.0);
    }
    X_WStart = hand.pose();
  }
  parts_->person.begin(sceneObjects(), X_WStart);
}

void InstructorStation::heard(const HandManifold& manifold) noexcept {
  if (parts_->hand) parts_->hand->receive(manifold);
}

void InstructorStation::stepChanged() { parts_->person.read(currentStep()); }

void InstructorStation::stopChanged(bool engaged) {
  if (parts_->hand) parts_->hand->stop(engaged);
}

void InstructorStation::step(std::uint32_t seq) noexcept {
  constexpr double dt = kTickSeconds;
  seq_ = seq;
  inputs_.clear();
  states_.clear();
  if (!parts_->hand) return;
  parts_->hand->step(seq, world_, dt);
  report(*parts_->hand);
  inputs_.push_back(parts_->hand->input());
  states_.push_back(parts_->hand->state());
  if (parts_->options.simulated_person) parts_->movePerson(world_, dt);
}

const char* InstructorStation::doing() const noexcept { return parts_->person.doing(); }

}  // namespace tenon
