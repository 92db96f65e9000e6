#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::IslandRig;
using test::sphereStructures;
using test::StructuresPtr;

/// A hand presses a box's face on an edge along x, and moves along it.
struct EdgeSlide {
  double lag = 0.0;                 ///< [m] largest distance of box and hand in the plane of the face
  double largest_force_step = 0.0;  ///< [N] from tick to tick
};

/// From x = `from` [m], the box turned by `yaw` [rad].
EdgeSlide slideAlongEdge(double from, double yaw) {
  const Pose X_WEdge(Vector3::Zero(), expRotation({0.25 * std::numbers::pi, 0.0, 0.0}));
  const double top = std::sqrt(0.5) * 0.05 + 0.0005;  // of the dilated edge
  const Quaternion turned = expRotation({0.0, 0.0, yaw});
  test::IslandRig rig;
  const auto box = rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004),
                               Pose(Vector3(from, 0.0, top + 0.02), turned));
  const test::StructuresPtr edge = test::boxStructures({0.3, 0.05, 0.05}, 0.002, 0.004);
  rig.addStatic(box, edge, X_WEdge, 0.0005);
  rig.addStaticShell(box, edge, X_WEdge, 0.0005);
  rig.moveHand(box, Pose(Vector3(from, 0.0, top + 0.002), turned), 50);
  EdgeSlide slide;
  Vector3 before = springWrench(rig.body(box).springs[0], rig.pose(box)).force;
  for (int tick = 1; tick <= 200; ++tick) {
    const Vector3 hand(from + 0.0005 * tick, 0.0, top + 0.002);
    rig.setHand(box, Pose(hand, turned));
    rig.step();
    slide.lag = std::max(slide.lag, (rig.pose(box).translation() - hand).head<2>().norm());
    const Vector3 now = springWrench(rig.body(box).springs[0], rig.pose(box)).force;
    slide.largest_force_step = std::max(slide.largest_force_step, (now - before).norm());
    before = now;
    EXPECT_GT(rig.force(0).force.z() - rig.force(1).force.z(), 1.0);
  }
  return slide;
}

//   |____|    the edge's points, 4 mm apart, pass under the box's rims and cell borders:
//     /\      exactly, nearly, and one after another
TEST(GodObject, SlidesAlongAnOuterEdgeWithoutLag) {
  double lag = 0.0;
  double largest_force_step = 0.0;
  for (const double from : {-0.05, -0.0495, -0.0487, -0.04812, -0.048, -0.0470001}) {
    for (const double yaw : {0.0, 0.1, 0.7}) {
      const EdgeSlide slide = slideAlongEdge(from, yaw);
      EXPECT_LE(slide.lag, 1e-5) << "from " << from << ", turned by " << yaw;
      lag = std::max(lag, slide.lag);
      largest_force_step = std::max(largest_force_step, slide.largest_force_step);
    }
  }
  EXPECT_LE(largest_force_step, 0.01);
  RecordProperty("lag_nm", static_cast<int>(std::lround(lag * 1e9)));
  RecordProperty("largest_force_step_mN", static_cast<int>(std::lround(largest_force_step * 1e3)));
}

//    ---o---      the hand presses a bar on an edge and turns it about that edge
//       ^
TEST(GodObject, ALeverTurnsFreelyAboutItsFulcrum) {
  const Pose X_WEdge(Vector3::Zero(), expRotation({0.0, 0.25 * std::numbers::pi, 0.0}));
  const double top = std::sqrt(0.5) * 0.05 + 0.0005;
  constexpr double kHalf = 0.01;
  constexpr double kPress = 0.005;
  test::IslandRig rig;
  const auto bar = rig.addBody(test::boxStructures({0.2, 0.02, 2.0 * kHalf}, 0.002, 0.004),
                               Pose(Vector3(0.0, 0.0, top + 0.03)));
  const test::StructuresPtr edge = test::boxStructures({0.05, 0.1, 0.05}, 0.002, 0.004);
  rig.addStatic(bar, edge, X_WEdge, 0.0005);
  rig.addStaticShell(bar, edge, X_WEdge, 0.0005);
  rig.moveHand(bar, Pose(Vector3(0.0, 0.0, top + kHalf - kPress)), 50);
  double error = 0.0;
  for (int tick = 1; tick <= 300; ++tick) {
    const Vector3 turn(0.0, 0.5 * std::sin(0.01 * std::numbers::pi * tick), 0.0);
    const Quaternion q = expRotation(turn);
    rig.setHand(bar, Pose(Vector3(0.0, 0.0, top) + q * Vector3(0.0, 0.0, kHalf - kPress), q));
    rig.step();
    error = std::max(error, logRotation(rig.pose(bar).rotation() * q.conjugate()).norm());
    ASSERT_GT((rig.force(0).force - rig.force(1).force).norm(), 1.0);
  }
  EXPECT_LE(error, 2e-3);
  RecordProperty("turn_error_urad", static_cast<int>(std::lround(error * 1e6)));
}

/// [N] Largest change of the hand's force per 0.1 mm of its path while it presses a ball on a box. The path
/// goes from `from` to `to` in the box's frame; `turn`: rotation vector of the box. `both`: the box's
/// pointshell is queried too, besides the ball's.
double largestForceStep(bool both, const Vector3& turn, const Vector3& from, const Vector3& to) {
  const Pose X_WBox(Vector3::Zero(), expRotation(turn));
  test::IslandRig rig;
  const auto ball =
      rig.addBody(test::sphereStructures(0.012, 0.001, 0.001), X_WBox * Pose(from + 0.02 * Vector3::UnitZ()));
  const test::StructuresPtr box = test::boxStructures({0.08, 0.08, 0.04}, 0.001, 0.001);
  rig.addStatic(ball, box, X_WBox, 0.0005);
  if (both) rig.addStaticShell(ball, box, X_WBox, 0.0005);
  rig.moveHand(ball, X_WBox * Pose(from), 60);
  rig.settle(20);
  const int steps = static_cast<int>((to - from).norm() / 1e-4);
  Vector3 before = springWrench(rig.body(ball).springs[0], rig.pose(ball)).force;
  double largest = 0.0;
  for (int i = 1; i <= steps; ++i) {
    const double fraction = static_cast<double>(i) / steps;
    rig.setHand(ball, Pose(X_WBox * Vector3(from + fraction * (to - from)), rig.pose(ball).rotation()));
    rig.step();
    const Vector3 now = springWrench(rig.body(ball).springs[0], rig.pose(ball)).force;
    largest = std::max(largest, (now - before).norm());
    before = now;
  }
  return largest;
}

// a hand 3 mm behind a face moves parallel to it: the force stays the same at every voxel border
TEST(GodObject, TheForceIsContinuousAcrossVoxelBorders) {
  const double z = 0.02 + 0.0125 - 0.003;
  const double step = largestForceStep(false, {0.2, 0.1, 0.3}, {-0.02, -0.01, z}, {0.02, 0.012, z});
  EXPECT_LE(step, 0.02);
  RecordProperty("largest_force_step_mN", static_cast<int>(std::lround(step * 1e3)));
}

// pairs in both directions, so that the edge does not catch between the ball's points
TEST(GodObject, TheForceIsContinuousAcrossAnEdge) {
  constexpr double kBallRadius = 0.0125;  // dilated
  constexpr double kDepth = 0.003;
  const double z = 0.02 + kBallRadius - kDepth;
  const double step = largestForceStep(true, {0.2, 0.1, 0.3}, {0.02, 0.004, z}, {0.06, 0.006, z});
  // an exact ball on an exact edge: 0.065 N. Points 1 mm apart on both leave height steps of 0.25 mm.
  EXPECT_LE(step, 0.3);
  RecordProperty("largest_force_step_mN", static_cast<int>(std::lround(step * 1e3)));
}

// a large face on a floor and a wall: each of its many constraints has discretisation errors of its own
TEST(GodObject, AHandAtRestNeedsFewStepsAndNoTraversal) {
  test::IslandRig rig;
  const Pose X_WH(Vector3(0.14, 0.13, 0.045), expRotation({0.05, 0.0, 0.02}));
  const auto box = rig.addBody(test::boxStructures({0.3, 0.2, 0.1}, 0.003, 0.0046),
                               Pose(X_WH.translation() + Vector3(0.1, 0.1, 0.15), X_WH.rotation()), 2000.0);
  rig.addStatic(box, test::cornerStructures(0.6, 0.003), Pose(), 0.0027);
  rig.setHand(box, X_WH);
  rig.settle(200);
  for (int tick = 0; tick < 50; ++tick) {
    const Pose before = rig.pose(box);
    const SolveReport report = rig.step();
    ASSERT_LE(report.steps, 2U);
    ASSERT_EQ(report.traversals, 0U) << "the lists are reused";
    ASSERT_TRUE(rig.pose(box) == before);
  }
}

}  // namespace
}  // namespace tenon::collision
