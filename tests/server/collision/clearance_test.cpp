#include <algorithm>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon {
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
/// One hand, one peg: the sheet of no thickness is a field of 3 mm voxels, the socket one of 0.115 mm. Each
/// pair has the dilation that its clearance asks for.
class PegSheetAndSocket : public testing::Test {
 protected:
  static constexpr double kSheetVoxel = 0.003;
  static constexpr double kSheetX = -0.2;

  PegSheetAndSocket() {
    peg_ = rig_.addBody(boxStructures({0.0195, 0.0195, 0.03}, 0.001, 0.0025),
                        Pose(Vector3(0.0002, -0.0001, 0.02), askew_));
    const StructuresPtr socket = socketStructures({0.02, 0.02, 0.02}, 0.003, 0.000115, 0.001);
    rig_.addStatic(peg_, socket, Pose(), 0.0001);
    rig_.addStaticShell(peg_, socket, Pose(), 0.0001);
    rig_.addStatic(peg_, sheetStructures(0.1, 0.0, kSheetVoxel, 0.0011), Pose(Vector3(kSheetX, 0.0, 0.0)),
                   0.87 * kSheetVoxel);
  }
  [[nodiscard]] double lowestPoint() const {
    double lowest = 1.0;
    for (const ShellPoint& point : rig_.shell(peg_).points()) {
      lowest = std::min(lowest, (rig_.pose(peg_) * point.p_MP.cast<double>()).z());
    }
    return lowest;
  }

  const Quaternion askew_ = expRotation({kTilt, 0.0, 0.0});
  IslandRig rig_;
  std::size_t peg_ = 0;
};

TEST_F(PegSheetAndSocket, TheSheetHoldsThePegAndTheSocketTakesItInAndGivesItBack) {
  // on the sheet, at 1 m/s, to 50 mm behind it
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, 0.05), askew_), 250);
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, -0.05), askew_), 100);
  rig_.settle(20);
  EXPECT_GT(lowestPoint(), 0.0011) << "through the sheet";
  EXPECT_GT(rig_.force(2).force.z(), 20.0);
  rig_.moveHand(peg_, Pose(Vector3(kSheetX, 0.0, 0.05), askew_), 100);

  // over the socket, in, and out again: a person aligns while the tip finds the hole, and pushes it home
  // askew
  rig_.moveHand(peg_, Pose(Vector3(0.0002, -0.0001, 0.03), askew_), 250);
  rig_.moveHand(peg_, Pose(Vector3(0.0002, -0.0001, 0.014), expRotation({0.01, 0.005, 0.0})), 100);
  rig_.moveHand(peg_, Pose(Vector3(0.0, 0.0, -0.0035), askew_), 500);
  EXPECT_LT(rig_.pose(peg_).translation().z(), -0.0025) << "not in";
  EXPECT_LT(logRotation(rig_.pose(peg_).rotation()).norm(), 0.02) << "the hole turns it straight";
  rig_.moveHand(peg_, Pose(Vector3(0.0, 0.0, 0.04), askew_), 500);
  EXPECT_NEAR(rig_.pose(peg_).translation().z(), 0.04, 1e-6) << "not out";
  EXPECT_GT(rig_.deepest_overlap, -5e-5);
}

}  // namespace
}  // namespace tenon
