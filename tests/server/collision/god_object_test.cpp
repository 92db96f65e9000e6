#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::IslandRig;
using test::sheetStructures;

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
    ASSERT_LE(rig.step().substeps, 2U);
    ASSERT_TRUE(rig.pose(box) == before);
  }
}

}  // namespace
}  // namespace tenon
