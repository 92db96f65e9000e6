#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::floorStructures;
using test::IslandRig;

constexpr double kCouplingStiffness = 1000.0;          // [N/m]
constexpr double kDepth = 0.01;                        // [m] of the hand below the box's resting height
constexpr double kRest = 0.0105;                       // [m]
constexpr double kLoad = kCouplingStiffness * kDepth;  // [N]

/// A hand presses a box on a floor tilted by `turn` [rad] about y. Coefficients `at_rest`, `sliding` [-].
struct PressedBox {
  PressedBox(double at_rest, double sliding, double turn = 0.0)
      : X_WFloor(Vector3::Zero(), expRotation({0.0, turn, 0.0})) {
    box = rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004),
                      X_WFloor * Pose(Vector3(0.0, 0.0, kRest + 0.001)), kCouplingStiffness);
    rig.addStatic(box, test::floorStructures(0.4, 0.002), X_WFloor, 0.0005);
    rig.setFriction(0, at_rest, sliding);
  }
  /// Moves the hand to `p`, in the floor's frame.
  void press(const Vector3& p, int ticks) { rig.moveHand(box, X_WFloor * Pose(p), ticks); }
  /// [m] Position of the box in the floor's frame.
  [[nodiscard]] Vector3 position() const { return X_WFloor.inverse() * rig.pose(box).translation(); }
  /// [N] On the box, in the floor's frame.
  [[nodiscard]] Vector3 force() const { return X_WFloor.rotation().conjugate() * rig.force(0).force; }

  Pose X_WFloor;
  test::IslandRig rig;
  std::size_t box = 0;
};

struct PullCase {
  const char* name;
  Vector3 direction;  ///< [-] unit vector in the floor's plane
};
void PrintTo(const PullCase& pull, std::ostream* out) { *out << pull.name; }

class FrictionOfAPull : public testing::TestWithParam<PullCase> {};

//    hand  ->      the box sticks until the hand pulls with mu times the load, then it slides
//   [box]
//  ~~~~~~~~~
TEST_P(FrictionOfAPull, SticksUpToTheStaticCoefficientTimesTheLoad) {
  const Vector3 direction = GetParam().direction;
  constexpr double kFriction = 0.4;
  PressedBox pressed(kFriction, kFriction);
  const Vector3 down(0.0, 0.0, kRest - kDepth);
  pressed.press(down, 50);
  const Vector3 start = pressed.position();
  double pull = 0.0;
  for (int tick = 1; tick <= 400 && (pressed.position() - start).norm() < 2e-5; ++tick) {
    const double stretch = 2e-5 * tick;
    pressed.press(down + stretch * direction, 1);
    pull = kCouplingStiffness * stretch;
  }
  EXPECT_NEAR(pull, kFriction * kLoad, 0.02 * kFriction * kLoad);
}

TEST_P(FrictionOfAPull, SlidesWithTheDynamicCoefficientTimesTheLoad) {
  const Vector3 direction = GetParam().direction;
  PressedBox pressed(0.4, 0.3);
  const Vector3 down(0.0, 0.0, kRest - kDepth);
  pressed.press(down, 50);
  for (int tick = 1; tick <= 150; ++tick) pressed.press(down + 2e-4 * tick * direction, 1);
  const Vector3 lag = down + 0.03 * direction - pressed.position();
  EXPECT_NEAR(kCouplingStiffness * lag.dot(direction), 0.3 * kLoad, 0.02 * 0.3 * kLoad);
  EXPECT_LE((lag - lag.dot(direction) * direction).head<2>().norm(), 1e-5);
  EXPECT_NEAR(pressed.force().dot(direction), -0.3 * pressed.force().z(), 0.02 * kLoad);
  // when the hand stops, the box does too
  const Vector3 end = pressed.position();
  pressed.rig.settle(50);
  EXPECT_LE((pressed.position() - end).norm(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Friction, FrictionOfAPull,
                         testing::Values(PullCase{"AlongX", {1.0, 0.0, 0.0}},
                                         PullCase{"AgainstX", {-1.0, 0.0, 0.0}},
                                         PullCase{"AlongY", {0.0, 1.0, 0.0}},
                                         PullCase{"Oblique", {0.6, -0.8, 0.0}}),
                         [](const auto& pull) { return pull.param.name; });

struct SlopeCase {
  const char* name;
  double degrees;
};
void PrintTo(const SlopeCase& slope, std::ostream* out) { *out << slope.name; }

class FrictionOnASlope : public testing::TestWithParam<SlopeCase> {};

//     the hand pulls vertically: a box rests on a slope whose tangent is less than the coefficient
//    \[]
//      \ .
TEST_P(FrictionOnASlope, HoldsABoxUpToASlopeWhoseTangentIsTheCoefficient) {
  const double slope = GetParam().degrees * std::numbers::pi / 180.0;
  for (const bool rests : {true, false}) {
    const double friction = std::abs(std::tan(slope)) * (rests ? 1.02 : 0.98);
    PressedBox pressed(friction, friction, slope);
    pressed.press(Vector3(0.0, 0.0, kRest), 10);
    const Vector3 start = pressed.position();
    const Vector3 down = pressed.X_WFloor.rotation().conjugate() * Vector3(0.0, 0.0, -kDepth);
    pressed.press(Vector3(0.0, 0.0, kRest) + down, 100);
    pressed.rig.settle(20);
    const double slip = (pressed.position() - start).head<2>().norm();
    if (rests) {
      EXPECT_LE(slip, 1e-6);
    } else {
      const double expected = std::abs(down.x()) - friction * std::abs(down.z());
      EXPECT_NEAR(slip, expected, 0.02 * expected + 2e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Friction, FrictionOnASlope,
                         testing::Values(SlopeCase{"Plus30Degrees", 30.0}, SlopeCase{"Minus30Degrees", -30.0},
                                         SlopeCase{"Plus45Degrees", 45.0},
                                         SlopeCase{"Minus45Degrees", -45.0}),
                         [](const auto& slope) { return slope.param.name; });

TEST(Friction, AHandThatMovesInACircleDoesTheWorkOfSlidingFriction) {
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
  // the second round slides all the time: work mu N s; the first may begin by sticking
  const double one_round = 0.2 * kLoad * 2.0 * std::numbers::pi * 0.01;
  EXPECT_GT(work, one_round);
  EXPECT_LT(work, 2.2 * one_round);
}

}  // namespace
}  // namespace tenon::collision
