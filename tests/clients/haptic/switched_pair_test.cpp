#include <algorithm>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/haptic_hand.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"
#include "server/simulation/environment.h"
#include "tests/support/analytic_structures.h"

// A hand holds a box that lies 10 mm deep in a plate, as long as the two do not collide. Then they do.

namespace tenon::haptic {
namespace {

constexpr HandId kHand{0};
constexpr ObjectId kPointer{0}, kBox{1}, kPlate{2};
constexpr double kDepth = 0.010;             // [m]
constexpr double kPairStiffness = 2000.0;    // [N/m] of the coupling
constexpr double kLeastSwitchedLimit = 3.0;  // [N]
constexpr double kSwitchedGrowth = 20.0;     // [N/s]
constexpr std::size_t kSwitchedWindow = 20;  // [ticks] over which the growth is measured

class HandInPlate : public testing::Test {
 protected:
  HandInPlate() : device_(std::move(*devices::openDevice("sigma7-sim"))), hand_(*device_) {
    auto scene = std::make_shared<simulation::Scene>();
    const auto add = [&](test::StructuresPtr structures, const Vector3& p_WO, ObjectStatus status) {
      simulation::ObjectSpec spec;
      spec.structures = std::move(structures);
      spec.X_WO = Pose(p_WO);
      spec.status = status;
      scene->objects.push_back(spec);
    };
    add(test::sphereStructures(0.012, 0.002, 0.003), {0.0, 0.0, 0.2}, ObjectStatus::kParked);
    add(test::boxStructures(Vector3::Constant(0.04), 0.002, 0.005), {0.0, 0.0, 0.02 - kDepth},
        ObjectStatus::kParked);
    add(test::boxStructures({0.2, 0.2, 0.04}, 0.002, 0.005), {0.0, 0.0, -0.02}, ObjectStatus::kFixed);
    simulation::HandSpec spec;
    spec.object = kPointer;
    spec.stiffness = kPairStiffness;
    scene->hands.push_back(spec);
    simulation::PairSpec pair;
    pair.a = kBox;
    pair.b = kPlate;
    pair.enabled = false;
    scene->pairs.push_back(pair);
    environment_ = std::make_unique<simulation::Environment>(scene, simulation::EnvironmentOptions{});
    std::vector<SceneObject> objects(3);
    for (std::uint32_t i = 0; i < 3; ++i) objects[i].object = ObjectId{i};
    world_.begin(objects, 0, 0);
    hand_.begin(kHand, ClientId{1}, Vector3(0.0, 0.0, 0.02 - kDepth), true);
    EXPECT_TRUE(hand_.armDevice());
    hand_.handBack();
    environment_->setHandPresent(kHand, true);
    environment_->setHandPose(kHand, hand_.pose(), {});
    environment_->grab(kHand, kBox);
    for (int i = 0; i < 1500; ++i) tick();  // the soft start is over
    EXPECT_LT(force(), 0.5);
  }

  /// One millisecond: the server answers the newest input, the station renders the answer.
  void tick() {
    arm().setIntent(hand_.workspace().toDevice(Pose(Vector3(0.0, 0.0, 0.02 - kDepth))));
    environment_->setHandPose(kHand, hand_.pose(), hand_.input().sample.V_WH);
    environment_->step();
    HandManifold manifold;
    environment_->manifold(kHand, manifold);
    manifold.answers_seq = hand_.input().sample.seq;
    WorldFrame frame;
    frame.tick = environment_->tick();
    for (std::uint32_t i = 0; i < 3; ++i) {
      ObjectState state;
      state.object = ObjectId{i};
      state.epoch = environment_->objects()[i].epoch;
      state.X_WO = environment_->objects()[i].X_WO;
      frame.states.push_back(state);
    }
    world_.receive(frame);
    hand_.receive(manifold);
    hand_.step(++seq_, world_, kTickSeconds);
  }
  [[nodiscard]] devices::HumanArm& arm() const { return *devices::simulatedHumanArm(*device_); }
  [[nodiscard]] double force() const { return hand_.state().F_Ho_W.force.norm(); }

  std::unique_ptr<devices::HapticDevice> device_;
  HapticHand hand_;
  WorldView world_;
  std::unique_ptr<simulation::Environment> environment_;
  std::uint32_t seq_ = 0;
};

TEST_F(HandInPlate, FeelsThatTheTwoCollideFromNowOnSoftly) {
  environment_->setPairEnabled(0, true);
  std::vector<double> forces{force()};
  for (std::size_t i = 1; i <= 1000; ++i) {
    tick();
    forces.push_back(force());
    ASSERT_LE(forces.back(), kLeastSwitchedLimit + 1e-3) << i << " ms after the switch";
    if (i < kSwitchedWindow) continue;
    const double growth = (forces[i] - forces[i - kSwitchedWindow]) / (kSwitchedWindow * kTickSeconds);
    ASSERT_LE(growth, kSwitchedGrowth + 0.5) << i << " ms after the switch";
  }
  EXPECT_TRUE(environment_->inContact(kBox, kPlate));
  EXPECT_GT(environment_->objects()[kBox.value].X_WO.translation().z(), 0.02 - 1e-3)
      << "it is out of the plate";
}

}  // namespace
}  // namespace tenon::haptic
