#include "clients/haptic/force_model_chooser.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "tests/clients/haptic/hand_above_floor.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::haptic {
namespace {

constexpr auto kManifold = ForceModelKind::kManifold;
constexpr auto kCopy = ForceModelKind::kSceneCopy;

TEST(ForceModelChooser, TakesTheCopyOverALongLinkAndTheManifoldOverAShortOne) {
  ForceModelChooser chooser(ForceModelWish::kAuto);
  EXPECT_EQ(chooser.step(0.05, false, 0), kManifold) << "there is no copy";
  EXPECT_EQ(chooser.step(0.003, true, 0), kManifold);
  EXPECT_EQ(chooser.step(0.005, true, 0), kCopy);
  EXPECT_EQ(chooser.step(0.003, true, 0), kCopy) << "not to and fro";
  EXPECT_EQ(chooser.step(std::nullopt, true, 0), kCopy) << "not known";
  EXPECT_EQ(chooser.step(0.001, true, 0), kManifold);
  EXPECT_EQ(ForceModelChooser(ForceModelWish::kManifold).step(0.05, true, 0), kManifold);
  EXPECT_EQ(ForceModelChooser(ForceModelWish::kSceneCopy).step(std::nullopt, true, 0), kCopy);
}

TEST(ForceModelChooser, AStationThatIsTooSlowDoesWithoutTheCopyForAMinute) {
  for (const auto wish : {ForceModelWish::kAuto, ForceModelWish::kSceneCopy}) {
    ForceModelChooser chooser(wish);
    EXPECT_EQ(chooser.step(0.05, true, 1000), kCopy) << "these were late without it";
    EXPECT_EQ(chooser.step(0.05, true, ForceModelChooser::kMostLate), kCopy);
    EXPECT_EQ(chooser.step(0.05, true, ForceModelChooser::kMostLate + 1), kManifold);
    for (std::uint32_t second = 1; second < ForceModelChooser::kWithout; ++second)
      EXPECT_EQ(chooser.step(0.05, true, 0), kManifold);
    EXPECT_EQ(chooser.step(0.05, true, 0), kCopy);
  }
}

/// The floor and the ball of PlaneServer.
std::shared_ptr<const simulation::Scene> planeScene() {
  test::SmallScene small;
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero(), ObjectStatus::kFixed);
  const ObjectId ball = small.object("ball", test::pointerShape(), {0.0, 0.0, 0.03});
  small.hand("right", ball);
  small.pair(ball, floor);
  return small.build();
}

//   the hand presses on the floor, and its contacts come from elsewhere from now on
TEST(ForceModelSwitch, OfModelsThatAgreeIsNotFelt) {
  test::HandAboveFloor setup("sigma7-sim");
  const auto press = [&](int ticks) {
    double largest = 0.0;
    for (int i = 0; i < ticks; ++i) {
      const Vector3 before = setup.hand.state().F_Ho_W.force;
      setup.step(Vector3(0.0, 0.0, -0.005));
      largest = std::max(largest, (setup.hand.state().F_Ho_W.force - before).norm());
    }
    return largest;
  };
  setup.hand.setCopy(std::make_unique<SceneCopy>(planeScene()));
  press(3000);
  ASSERT_GT(setup.force(), 2.0);
  const double steady = setup.force();
  for (const ForceModelKind kind : {kCopy, kManifold, kCopy}) {
    setup.hand.setForceModel(kind);
    EXPECT_LT(press(500), 0.3);
    EXPECT_EQ(setup.hand.forceModel(), kind);
    EXPECT_NEAR(setup.force(), steady, 0.1 * steady) << "nor does it stop";
  }
}

//   the server has a larger ball than the copy: where the copy feels little the server's contacts ask for
//   more
TEST(ForceModelSwitch, AModelThatAsksForMoreGetsItByTwentyNewtonsASecond) {
  constexpr int kCopyFor = 200;  // [ms] then the copy is found to be elsewhere, and jumps
  constexpr int kWithin = 20;    // [ms]
  test::HandAboveFloor setup("sigma7-sim");
  setup.server.radius = 0.022;
  const auto press = [&](int ticks) {
    std::vector<double> forces;
    for (int i = 0; i < ticks; ++i) {
      setup.step(Vector3(0.0, 0.0, -0.005));
      forces.push_back(setup.force());
    }
    return forces;
  };
  setup.hand.setCopy(std::make_unique<SceneCopy>(planeScene()));
  press(3000);
  const double steady = setup.force();
  ASSERT_GT(steady, 2.0);
  setup.hand.setForceModel(kCopy);
  press(kCopyFor);
  ASSERT_EQ(setup.hand.forceModel(), kCopy);
  ASSERT_LT(setup.force(), steady - 0.5);
  setup.hand.setForceModel(kManifold);
  std::vector<double> forces{setup.force()};
  for (const double force : press(2000)) forces.push_back(force);
  for (std::size_t i = kWithin; i < 200; ++i)
    ASSERT_LE(forces[i] - forces[i - kWithin], 20.0 * kWithin * kTickSeconds + 0.3) << i << " ms";
  EXPECT_NEAR(forces.back(), steady, 0.6) << "dry friction of 0.3 N, either way";
}

}  // namespace
}  // namespace tenon::haptic
