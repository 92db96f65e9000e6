#include "clients/simulated_person/people.h"

#include <array>
#include <cstddef>

#include "clients/simulated_person/motor_intent.h"
#include "clients/simulated_person/simulated_instructor.h"
#include "clients/simulated_person/simulated_trainee.h"

namespace tenon::simulated_person {
namespace {

// Fraction of a device's workspace radius that a person uses: stays clear of the wall of the safety layer.
constexpr double kTraineeReach = 0.94;     // [-]
constexpr double kInstructorReach = 0.90;  // [-]

/// `reach` [-] of the device's workspace radius.
HandPerception perceive(const haptic::HapticHand* hand, double reach) {
  HandPerception perception;
  if (hand == nullptr) return perception;
  perception.hand = hand->id();
  perception.X_WH = hand->pose();
  perception.F_Ho_W = hand->state().F_Ho_W;
  if (hand->local().hasManifold()) {
    perception.object = hand->local().manifold().object;
    perception.X_HO = hand->local().manifold().X_HO;
  }
  perception.p_WC = hand->state().p_WC;
  perception.reach = reach * hand->caps().workspace_radius;
  perception.declutches = hand->caps().declutch != 0;
  perception.indexing = hand->state().indexing;
  return perception;
}

/// What the arm intends when its person wants the hand at X_WI. In a fault it waits at the handle.
const Pose& intended(MotorIntent& intent, haptic::HapticHand& hand, const Pose& X_WI) {
  return hand.faulty() ? intent.rest(hand.device().X_DH) : intent.towards(hand.workspace().toDevice(X_WI));
}

class TraineeMover final : public haptic::Mover {
 public:
  explicit TraineeMover(const PersonOptions& person) : person_(person) {}

  void begin(std::span<const SceneObject> objects, std::span<const haptic::MovedHand> hands) override {
    left_ = right_ = hands.size();
    std::array<Pose, 2> starts;
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (hands[i].name == "left") {
        left_ = i;
        starts[1] = hands[i].X_WStart;
      } else if (right_ == hands.size()) {
        right_ = i;
        starts[0] = hands[i].X_WStart;
      }
    }
    for (MotorIntent& intent : intents_) intent.reset();
    person_.begin(objects, starts[0], starts[1]);
  }

  void read(const StepState& step) override { person_.read(step); }

  void step(std::span<haptic::MovedHand> hands, const haptic::WorldView& world) noexcept override {
    const auto perceiveHand = [&](std::size_t i) {
      return perceive(i < hands.size() ? hands[i].hand : nullptr, kTraineeReach);
    };
    person_.step(perceiveHand(right_), perceiveHand(left_), world, kTickSeconds);
    if (right_ < hands.size()) move(hands[right_], person_.right(), intents_[0]);
    if (left_ < hands.size()) move(hands[left_], person_.left(), intents_[1]);
  }

  [[nodiscard]] const char* activity() const noexcept override { return person_.activity(); }

 private:
  static void move(haptic::MovedHand& moved, const TraineeHand& person, MotorIntent& intent) noexcept {
    if (moved.hand == nullptr) return;
    const haptic::Workspace& workspace = moved.hand->workspace();
    const AssemblyBehavior& behavior = person.behavior;
    const Declutching& declutching = person.declutching;
    const Twist& velocity = behavior.intendedVelocity();
    moved.intent.contraction = behavior.contraction();
    moved.intent.buttons = declutching.presses() ? moved.hand->caps().declutch : 0;
    if (declutching.busy() && !moved.hand->faulty()) {
      moved.intent.X_DI = intent.towards(declutching.intendedDevicePose());
      moved.intent.V_DI = {};
      return;
    }
    moved.intent.X_DI = intended(intent, *moved.hand, behavior.intendedPose());
    moved.intent.V_DI = {velocity.linear - workspace.velocity(), velocity.angular};
  }

  SimulatedTrainee person_;
  std::array<MotorIntent, 2> intents_;  // right, left
  std::size_t right_ = 0;
  std::size_t left_ = 0;
};

class InstructorMover final : public haptic::Mover {
 public:
  explicit InstructorMover(const PersonOptions& person) : person_(person) {}

  void begin(std::span<const SceneObject> objects, std::span<const haptic::MovedHand> hands) override {
    intent_.reset();
    person_.begin(objects, hands.front().X_WStart);
  }

  void read(const StepState& step) override { person_.read(step); }

  void step(std::span<haptic::MovedHand> hands, const haptic::WorldView& world) noexcept override {
    haptic::MovedHand& moved = hands.front();
    if (moved.hand == nullptr) return;
    haptic::Workspace& workspace = moved.hand->workspace();
    person_.step(perceive(moved.hand, kInstructorReach), workspace, world, kTickSeconds);
    moved.intent.X_DI = intended(intent_, *moved.hand, person_.intendedPose());
    moved.intent.contraction = person_.contraction();
  }

  [[nodiscard]] const char* activity() const noexcept override { return person_.activity(); }

 private:
  SimulatedInstructor person_;
  MotorIntent intent_;
};

}  // namespace

std::unique_ptr<haptic::Mover> makeTrainee(const PersonOptions& person) {
  return std::make_unique<TraineeMover>(person);
}

std::unique_ptr<haptic::Mover> makeInstructor(const PersonOptions& person) {
  return std::make_unique<InstructorMover>(person);
}

}  // namespace tenon::simulated_person
