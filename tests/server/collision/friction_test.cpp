#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon {
namespace {

using test::boxStructures;
using test::floorStructures;
using test::IslandRig;

constexpr double kStiffness = 1000.0;
constexpr double kDepth = 0.01;  // of the hand below where the box rests
constexpr double kRest = 0.0105;
constexpr double kLoad = kStiffness * kDepth;

/// A box that a hand presses on a floor, turned by `turn` about y.
struct PressedBox {
  PressedBox(double at_rest, double sliding, double turn = 0.0)
      : X_WFloor(Vector3::Zero(), expRotation({0.0, turn, 0.0})) {
    box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004),
                      X_WFloor * Pose(Vector3(0.0, 0.0, kRest + 0.001)), kStiffness);
    rig.addStatic(box, floorStructures(0.4, 0.002), X_WFloor, 0.0005);
    rig.setFriction(0, at_rest, sliding);
  }
  /// `p`: where the hand goes, in the floor's frame.
  void press(const Vector3& p, int ticks) { rig.moveHand(box, X_WFloor * Pose(p), ticks); }
  [[nodiscard]] Vector3 place() const { return X_WFloor.inverse() * rig.pose(box).translation(); }
  [[nodiscard]] Vector3 force() const { return X_WFloor.rotation().conjugate() * rig.force(0).force; }

  Pose X_WFloor;
  IslandRig rig;
  std::size_t box = 0;
};

class Sides : public testing::TestWithParam<Vector3> {};

//    hand  ->      the box stays until the hand pulls with mu times the load, and follows from then on
//   [box]
//  ~~~~~~~~~
TEST_P(Sides, ABoxSticksUntilThePullIsTheCoefficientTimesTheLoad) {
  constexpr double kFriction = 0.4;
  PressedBox pressed(kFriction, kFriction);
  const Vector3 down(0.0, 0.0, kRest - kDepth);
  pressed.press(down, 50);
  const Vector3 start = pressed.place();
  double pull = 0.0;
  for (int tick = 1; tick <= 400 && (pressed.place() - start).norm() < 2e-5; ++tick) {
    const double way = 2e-5 * tick;
    pressed.press(down + way * GetParam(), 1);
    pull = kStiffness * way;
  }
  EXPECT_NEAR(pull, kFriction * kLoad, 0.02 * kFriction * kLoad);
}

TEST_P(Sides, ASlidingBoxIsBehindItsHandByTheSlidingFriction) {
  PressedBox pressed(0.4, 0.3);
  const Vector3 down(0.0, 0.0, kRest - kDepth);
  pressed.press(down, 50);
  for (int tick = 1; tick <= 150; ++tick) pressed.press(down + 2e-4 * tick * GetParam(), 1);
  const Vector3 lag = down + 0.03 * GetParam() - pressed.place();
  EXPECT_NEAR(kStiffness * lag.dot(GetParam()), 0.3 * kLoad, 0.02 * 0.3 * kLoad);
  EXPECT_LE((lag - lag.dot(GetParam()) * GetParam()).head<2>().norm(), 1e-5);
  EXPECT_NEAR(pressed.force().dot(GetParam()), -0.3 * pressed.force().z(), 0.02 * kLoad);
  // and it rests where the hand stops
  const Vector3 end = pressed.place();
  pressed.rig.settle(50);
  EXPECT_LE((pressed.place() - end).norm(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Friction, Sides,
                         testing::Values(Vector3(1.0, 0.0, 0.0), Vector3(-1.0, 0.0, 0.0),
                                         Vector3(0.0, 1.0, 0.0), Vector3(0.6, -0.8, 0.0)));

class Slopes : public testing::TestWithParam<double> {};

//     hand straight below: a box rests on a slope whose tangent is less than the coefficient
//    \[]
//      \ .
TEST_P(Slopes, ABoxRestsWhereTheCoefficientIsTheSlopesTangent) {
  const double slope = GetParam() * std::numbers::pi / 180.0;
  for (const bool rests : {true, false}) {
    const double friction = std::abs(std::tan(slope)) * (rests ? 1.02 : 0.98);
    PressedBox pressed(friction, friction, slope);
    pressed.press(Vector3(0.0, 0.0, kRest), 10);
    const Vector3 start = pressed.place();
    const Vector3 down = pressed.X_WFloor.rotation().conjugate() * Vector3(0.0, 0.0, -kDepth);
    pressed.press(Vector3(0.0, 0.0, kRest) + down, 100);
    pressed.rig.settle(20);
    const double way = (pressed.place() - start).head<2>().norm();
    if (rests) {
      EXPECT_LE(way, 1e-6);
    } else {
      const double free_way = std::abs(down.x()) - friction * std::abs(down.z());
      EXPECT_NEAR(way, free_way, 0.02 * free_way + 2e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Friction, Slopes, testing::Values(30.0, -30.0, 45.0, -45.0));

TEST(Friction, AHandThatGoesRoundInACirclePaysForIt) {
  PressedBox pressed(0.3, 0.2);
  const auto hand = [](int tick) {
    const double angle = 2.0 * std::numbers::pi * tick / 200.0;
    return Vector3(0.01 * std::cos(angle), 0.01 * std::sin(angle), kRest - kDepth);
  };
  pressed.press(hand(0), 50);
  pressed.rig.settle(5);
  double work = 0.0;
  Vector3 before = hand(0);
  for (int tick = 1; tick <= 400; ++tick) {
    pressed.press(hand(tick), 1);
    const MovableBody& body = pressed.rig.body(pressed.box);
    work += springWrench(body.springs[0], body.X_WB).force.dot(hand(tick) - before);
    before = hand(tick);
  }
  // the second round is all sliding: mu N s, at least half of it in both together
  const double one_round = 0.2 * kLoad * 2.0 * std::numbers::pi * 0.01;
  EXPECT_GT(work, one_round);
  EXPECT_LT(work, 2.2 * one_round);
}

}  // namespace
}  // namespace tenon
