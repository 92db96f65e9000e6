#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::IslandRig;
using test::sheetStructures;
using test::sphereStructures;
using test::StructuresPtr;

constexpr double kVoxel = 0.003;
constexpr double kDilation = 0.87 * kVoxel;  // the least that keeps a sheet of no thickness solid
constexpr int kOffsets = 12;                 // of the sheet between two layers of samples

/// [m] The deepest gap of any tick in the dilated field, and where the lowest point of the box ends above
/// the true sheet.
struct Outcome {
  double deepest_in_field = 0.0;
  double end = 0.0;
};

Outcome push(double thickness, double offset, double speed, double turn_speed) {
  IslandRig rig;
  const Pose start(Vector3(0.003, 0.002, 0.04), expRotation({0.17, 0.05, 0.0}));
  const auto box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.003), start);
  rig.addStatic(box, sheetStructures(0.3, thickness, kVoxel, offset), Pose(), kDilation);
  for (int tick = 0; tick < 200; ++tick) {
    const double z = std::max(0.04 - speed * 1e-3 * tick, -0.05);
    const double turn = std::min(turn_speed * 1e-3 * tick, 1.5);
    rig.setHand(box, Pose(Vector3(0.003, 0.002, z), start.rotation() * expRotation({0.0, turn, 0.0})));
    rig.step();
  }
  double lowest = 1.0;
  for (const ShellPoint& point : rig.shell(box).points()) {
    lowest = std::min(lowest, (rig.pose(box) * point.p_MP.cast<double>()).z() - offset);
  }
  return {-rig.deepest_overlap, lowest};
}

struct PushCase {
  const char* name;
  double thickness;
  double speed;
  double turn_speed;
};

class SheetAtEveryOffset : public testing::TestWithParam<PushCase> {};

//   |  v  with a turn or without, on to 50 mm behind
//   v
//  -----  wherever the sheet lies between two layers of samples
TEST_P(SheetAtEveryOffset, HoldsTheBox) {
  const PushCase& one = GetParam();
  double deepest = 0.0;
  for (int i = 0; i < kOffsets; ++i) {
    const Outcome outcome = push(one.thickness, kVoxel * i / kOffsets, one.speed, one.turn_speed);
    EXPECT_GE(outcome.end, 0.0) << "through the sheet at offset " << i;
    deepest = std::max(deepest, outcome.deepest_in_field);
  }
  EXPECT_LE(deepest, 5e-5);
  RecordProperty("deepest_in_field_um", static_cast<int>(std::lround(deepest * 1e6)));
}

INSTANTIATE_TEST_SUITE_P(GodObject, SheetAtEveryOffset,
                         testing::Values(PushCase{"OneMillimetreAt1", 0.001, 1.0, 0.0},
                                         PushCase{"OneMillimetreAt3", 0.001, 3.0, 0.0},
                                         PushCase{"OneMillimetreTurning", 0.001, 1.0, 10.0},
                                         PushCase{"NothingAt1", 0.0, 1.0, 0.0},
                                         PushCase{"NothingAt3", 0.0, 3.0, 0.0},
                                         PushCase{"NothingTurning", 0.0, 1.0, 10.0}),
                         [](const auto& one) { return one.param.name; });

/// [m] and [N] of a hand that presses a box's face on an edge that lies along x, and goes along it.
struct EdgeSlide {
  double lag = 0.0;
  double largest_step = 0.0;
};

EdgeSlide slideAlongEdge(double from, double yaw) {
  const Pose X_WEdge(Vector3::Zero(), expRotation({0.25 * std::numbers::pi, 0.0, 0.0}));
  const double top = std::sqrt(0.5) * 0.05 + 0.0005;  // of the dilated edge
  const Quaternion turned = expRotation({0.0, 0.0, yaw});
  IslandRig rig;
  const auto box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004),
                               Pose(Vector3(from, 0.0, top + 0.02), turned));
  const StructuresPtr edge = boxStructures({0.3, 0.05, 0.05}, 0.002, 0.004);
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
    slide.largest_step = std::max(slide.largest_step, (now - before).norm());
    before = now;
    EXPECT_GT(rig.force(0).force.z() - rig.force(1).force.z(), 1.0);
  }
  return slide;
}

//   |____|    the edge's points, 4 mm apart, come under the box's rims and its cells' borders: exactly,
//     /\      nearly, and one after another
TEST(GodObject, SlidesAlongAnOuterEdgeWithoutLag) {
  double lag = 0.0;
  double largest_step = 0.0;
  for (const double from : {-0.05, -0.0495, -0.0487, -0.04812, -0.048, -0.0470001}) {
    for (const double yaw : {0.0, 0.1, 0.7}) {
      const EdgeSlide slide = slideAlongEdge(from, yaw);
      EXPECT_LE(slide.lag, 1e-5) << "from " << from << ", turned by " << yaw;
      lag = std::max(lag, slide.lag);
      largest_step = std::max(largest_step, slide.largest_step);
    }
  }
  EXPECT_LE(largest_step, 0.01);
  RecordProperty("lag_nm", static_cast<int>(std::lround(lag * 1e9)));
  RecordProperty("largest_step_mN", static_cast<int>(std::lround(largest_step * 1e3)));
}

//    ---o---      the hand turns a bar about the edge that it presses the bar on: a lever turns freely
//       ^
TEST(GodObject, ALeverTurnsFreelyAboutItsFulcrum) {
  const Pose X_WEdge(Vector3::Zero(), expRotation({0.0, 0.25 * std::numbers::pi, 0.0}));
  const double top = std::sqrt(0.5) * 0.05 + 0.0005;
  constexpr double kHalf = 0.01;
  constexpr double kPress = 0.005;
  IslandRig rig;
  const auto bar =
      rig.addBody(boxStructures({0.2, 0.02, 2.0 * kHalf}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, top + 0.03)));
  const StructuresPtr edge = boxStructures({0.05, 0.1, 0.05}, 0.002, 0.004);
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

/// [N] The largest change of the force on the hand for 0.1 mm of its way, from and to in the frame of the box
/// on which its ball rests; `turn`: of that box. Asked with the ball's points alone or with the box's too.
double largestForceStep(bool both, const Vector3& turn, const Vector3& from, const Vector3& to) {
  const Pose X_WBox(Vector3::Zero(), expRotation(turn));
  IslandRig rig;
  const auto ball =
      rig.addBody(sphereStructures(0.012, 0.001, 0.001), X_WBox * Pose(from + 0.02 * Vector3::UnitZ()));
  const StructuresPtr box = boxStructures({0.08, 0.08, 0.04}, 0.001, 0.001);
  rig.addStatic(ball, box, X_WBox, 0.0005);
  if (both) rig.addStaticShell(ball, box, X_WBox, 0.0005);
  rig.moveHand(ball, X_WBox * Pose(from), 60);
  rig.settle(20);
  const int steps = static_cast<int>((to - from).norm() / 1e-4);
  Vector3 before = springWrench(rig.body(ball).springs[0], rig.pose(ball)).force;
  double largest = 0.0;
  for (int i = 1; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    rig.setHand(ball, Pose(X_WBox * Vector3(from + share * (to - from)), rig.pose(ball).rotation()));
    rig.step();
    const Vector3 now = springWrench(rig.body(ball).springs[0], rig.pose(ball)).force;
    largest = std::max(largest, (now - before).norm());
    before = now;
  }
  return largest;
}

// a hand 3 mm behind a face: its own way leaves the force as it is, whatever border of voxels is crossed
TEST(GodObject, TheForceIsContinuousAcrossVoxelBorders) {
  const double z = 0.02 + 0.0125 - 0.003;
  const double step = largestForceStep(false, {0.2, 0.1, 0.3}, {-0.02, -0.01, z}, {0.02, 0.012, z});
  EXPECT_LE(step, 0.02);
  RecordProperty("largest_step_mN", static_cast<int>(std::lround(step * 1e3)));
}

// asked both ways, so that the edge does not catch in the ball's points
TEST(GodObject, TheForceIsContinuousAcrossAnEdge) {
  constexpr double kReach = 0.0125;
  constexpr double kDepth = 0.003;
  const double z = 0.02 + kReach - kDepth;
  const double step = largestForceStep(true, {0.2, 0.1, 0.3}, {0.02, 0.004, z}, {0.06, 0.006, z});
  // a smooth ball on a smooth edge: 0.065 N; points 1 mm apart on both leave steps of a quarter millimetre
  EXPECT_LE(step, 0.3);
  RecordProperty("largest_step_mN", static_cast<int>(std::lround(step * 1e3)));
}

// a large face on a floor and a wall, where every row has a field's step of its own
TEST(GodObject, AStillHandStopsTheSearchEarly) {
  IslandRig rig;
  const Pose X_WH(Vector3(0.14, 0.13, 0.045), expRotation({0.05, 0.0, 0.02}));
  const auto box = rig.addBody(boxStructures({0.3, 0.2, 0.1}, 0.003, 0.0046),
                               Pose(X_WH.translation() + Vector3(0.1, 0.1, 0.15), X_WH.rotation()), 2000.0);
  rig.addStatic(box, cornerStructures(0.6, 0.003), Pose(), 0.0027);
  rig.setHand(box, X_WH);
  rig.settle(200);
  for (int tick = 0; tick < 50; ++tick) {
    const Pose before = rig.pose(box);
    const SolveReport report = rig.step();
    ASSERT_LE(report.substeps, 2U);
    ASSERT_EQ(report.queries, 0U) << "what was listed serves again";
    ASSERT_TRUE(rig.pose(box) == before);
  }
}

}  // namespace
}  // namespace tenon
