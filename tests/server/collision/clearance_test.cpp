#include <algorithm>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::IslandRig;
using test::sheetStructures;
using test::socketStructures;
using test::StructuresPtr;

constexpr double kTilt = 0.035;  // 2 degrees

//                 |  |  peg 19.5 mm
//   sheet     ~~~|    |~~~  socket 20 mm
//  --------      |____|
/// One hand, one peg: the sheet of zero thickness has a field of 3 mm voxels, the socket one of 0.115 mm.
/// Each pair has the dilation that its clearance requires.
class PegSheetAndSocket : public testing::Test {
 protected:
  static constexpr double kSheetVoxel = 0.003;
  static constexpr double kSheetX = -0.2;

  PegSheetAndSocket() {
    peg_ = rig_.addBody(test::boxStructures({0.0195, 0.0195, 0.03}, 0.001, 0.0025),
                        Pose(Vector3(0.0002, -0.0001, 0.02), tilted_));
    const test::StructuresPtr socket = test::socketStructures({0.02, 0.02, 0.02}, 0.003, 0.000115, 0.001);
    rig_.addStatic(peg_, socket, Pose(), 0.0001);
    rig_.addStaticShell(peg_, socket, Pose(), 0.0001);
    rig_.addStatic(peg_, test::sheetStructures(0.1, 0.0, kSheetVoxel, 0.0011),
                   Pose(Vector3(kSheetX, 0.0, 0.0)), 0.87 * kSheetVoxel);
  }
  [[nodiscard]] double lowestPoint() const {
    double lowest = 1.0;
    for (const structures::ShellPoint& point : rig_.shell(peg_).points()) {
      lowest = std::min(lowest, (rig_.pose(peg_) * point.p_MP.cast<double>()).z());
    }
    return lowest;
  }

  const Quaternion tilted_ = expRotation({kTilt, 0.0, 0.0});
  test::IslandRig rig_;
  std::size_t peg_ = 0;
};

TEST_F(PegSheetAndSocket, TheSheetBlocksThePegAndTheSocketPermitsInsertionAndRetraction) {
  // the hand goes through the sheet at 1 m/s, to 50 mm behind it
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, 0.05), tilted_), 250);
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, -0.05), tilted_), 100);
  rig_.settle(20);
  EXPECT_GT(lowestPoint(), 0.0011) << "through the sheet";
  EXPECT_GT(rig_.force(2).force.z(), 20.0);
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, 0.05), tilted_), 100);

  // over the socket, in, and out again: aligned while the tip finds the hole, tilted while it is pushed in
  rig_.moveHand(peg_, Pose(Vector3(0.0002, -0.0001, 0.03), tilted_), 250);
  rig_.moveHand(peg_, Pose(Vector3(0.0002, -0.0001, 0.014), expRotation({0.01, 0.005, 0.0})), 100);
  rig_.moveHand(peg_, Pose(Vector3(0.0, 0.0, -0.0035), tilted_), 500);
  EXPECT_LT(rig_.pose(peg_).translation().z(), -0.0025) << "not inserted";
  EXPECT_LT(logRotation(rig_.pose(peg_).rotation()).norm(), 0.02) << "the hole aligns it";
  rig_.moveHand(peg_, Pose(Vector3(0.0, 0.0, 0.04), tilted_), 500);
  EXPECT_NEAR(rig_.pose(peg_).translation().z(), 0.04, 1e-6) << "not retracted";
  EXPECT_GT(rig_.smallest_gap, -5e-5);
}

}  // namespace
}  // namespace tenon::collision
