#include "clients/instructor/instructor_station.h"

#include <optional>

#include "clients/haptic/haptic_hand.h"
#include "clients/simulated_person/motor_intent.h"
#include "clients/simulated_person/simulated_instructor.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::instructor {

namespace {
// Fraction of the device's workspace radius that is used: stays clear of the wall of the safety layer.
constexpr double kWorkspaceFraction = 0.9;
}  // namespace

struct InstructorStation::Parts {
  explicit Parts(const InstructorOptions& station) : options(station), person(station.person) {}

  InstructorOptions options;
  std::unique_ptr<devices::HapticDevice> device;
  std::optional<haptic::HapticHand> hand;
  simulated_person::SimulatedInstructor person;
  simulated_person::MotorIntent intent;

  void movePerson(const haptic::WorldView& world, double dt) {
    devices::HumanArm* const human_arm = devices::simulatedHumanArm(*device);
    if (human_arm == nullptr) return;
    simulated_person::HandPerception perception;
    perception.hand = hand->id();
    perception.X_WH = hand->pose();
    perception.F_Ho_W = hand->state().F_Ho_W;
    if (hand->local().hasManifold()) {
      perception.object = hand->local().manifold().object;
      perception.X_HO = hand->local().manifold().X_HO;
    }
    haptic::Workspace& workspace = hand->workspace();
    perception.p_WC = workspace.centre();
    perception.reach = kWorkspaceFraction * hand->caps().workspace_radius;
    person.step(perception, workspace, world, dt);
    human_arm->setIntent(intent.towards(workspace.toDevice(person.intendedPose())));
    human_arm->setContraction(person.contraction());
  }
};

InstructorStation::InstructorStation(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

InstructorStation::~InstructorStation() {
  if (parts_->hand) parts_->hand->end();
}

Result<std::unique_ptr<InstructorStation>> InstructorStation::open(const InstructorOptions& options) {
  auto parts = std::make_unique<Parts>(options);
  auto device = devices::openDevice(options.device, options.person.seed);
  if (!device) return fail(device.error().what);
  parts->device = std::move(*device);
  std::unique_ptr<InstructorStation> station(new InstructorStation(std::move(parts)));
  if (options.simulated_person) station->press();  // as the simulated trainee does
  return station;
}

std::vector<std::string> InstructorStation::handNames() const { return {"instructor"}; }

void InstructorStation::begin(std::span<const HandId> hand_ids) {
  parts_->hand.reset();
  parts_->intent.reset();
  Vector3 start(-0.1, -0.3, 1.25);
  for (const SceneObject& object : sceneObjects()) {
    if (object.kind == "assistant") start = object.X_WO.translation();
  }
  Pose X_WStart(start);
  if (hand_ids[0].valid()) {
    haptic::HapticHand& hand = parts_->hand.emplace(*parts_->device);
    if (!hand.begin(hand_ids[0], client_, start, arming().permitsForces())) {
      report(haptic::StationEventKind::kDeviceFault, hand_ids[0],
             static_cast<std::uint32_t>(hand.device().fault), 0.0);
    }
    X_WStart = hand.pose();
  }
  parts_->person.begin(sceneObjects(), X_WStart);
}

void InstructorStation::manifoldReceived(const HandManifold& manifold) noexcept {
  if (parts_->hand) parts_->hand->receive(manifold);
}

void InstructorStation::stepChanged() { parts_->person.read(currentStep()); }

void InstructorStation::armingChanged() noexcept {
  if (parts_->hand) parts_->hand->permitForces(arming().permitsForces());
}

Result<void> InstructorStation::armDevices() {
  return parts_->hand ? parts_->hand->armDevice() : Result<void>{};
}

void InstructorStation::step(std::uint32_t seq) noexcept {
  seq_ = seq;
  inputs_.clear();
  states_.clear();
  if (parts_->options.simulated_person) pressLikeAPerson();
  if (!parts_->hand) return;
  parts_->hand->step(seq, world_, dt_);
  report(*parts_->hand);
  inputs_.push_back(parts_->hand->input());
  states_.push_back(parts_->hand->state());
  if (parts_->options.simulated_person) parts_->movePerson(world_, kTickSeconds);
}

const char* InstructorStation::activity() const noexcept { return parts_->person.activity(); }

}  // namespace tenon::instructor
