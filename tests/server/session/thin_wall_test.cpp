#include <algorithm>
#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/wall_scene.h"

namespace tenon::session {
namespace {

using test::WallCase;
using test::WallScene;

/// [m] Furthest that a point of a held part may be behind an exact wall.
constexpr double kMostBehind = 0.0003;

/// Tilts of a wall against the axes of the field [rad]: none, about an axis, so that it lies across the
/// diagonal of the voxels, and small ones; with each an offset [voxels].
struct WallPlacement {
  Vector3 tilt;
  double offset;
};
const std::array<WallPlacement, 4> kPlacements{{{{0.0, 0.0, 0.0}, 0.5},
                                                {{0.3, 0.0, 0.0}, 0.0},
                                                {{0.61548, -0.61548, 0.0}, 0.8},
                                                {{0.04, 0.07, 0.2}, 0.3}}};
constexpr std::array<double, 3> kSpeeds{0.1, 1.0, 3.0};  // [m/s]

class WallBesideAClearance : public testing::TestWithParam<double> {
 protected:
  /// A wall of the test's thickness at each placement, with `voxel` [m], beside a mounting place with
  /// `clearance` [m]. Speeds take turns.
  void expectSolid(double voxel, double clearance) {
    double behind = -1.0;
    auto turn = static_cast<std::size_t>(std::lround(GetParam() * 2e3));
    for (const WallPlacement& placement : kPlacements) {
      const WallScene wall({.thickness = GetParam(),
                            .voxel = voxel,
                            .clearance = clearance,
                            .tilt = placement.tilt,
                            .offset = placement.offset * voxel * Vector3(0.3, 0.7, 1.0)});
      ASSERT_TRUE(wall.loaded()) << wall.loaded().error().what;
      EXPECT_EQ(wall.bay().info.open_area, 0.0);
      const double speed = kSpeeds[turn++ % kSpeeds.size()];
      const WallScene::Push push = wall.push(speed);
      EXPECT_LE(push.behind, kMostBehind) << "tilt " << placement.tilt.transpose() << ", " << speed << " m/s";
      EXPECT_GT(push.final_force, 10.0) << "tilt " << placement.tilt.transpose() << ", " << speed << " m/s";
      behind = std::max(behind, push.behind);
    }
    RecordProperty("behind_um", static_cast<int>(std::lround(behind * 1e6)));
  }
};

//   |  v   the hand goes 50 mm behind the wall; the box has a clearance of a few millimetres to the same
//   object
//  =====   elsewhere
TEST_P(WallBesideAClearance, IsSolidWithVoxelsOfFiveMillimetres) { expectSolid(0.005, 0.0022); }
TEST_P(WallBesideAClearance, IsSolidWithVoxelsOfThreeMillimetres) { expectSolid(0.003, 0.0013); }

//   a refined wall of one layer of triangles, 4 mm voxels / 8: next to the refined bricks it is as thick as
//   coarse voxels need, and thins out inside of bricks that are refined for that
TEST(WallInARefinedPlace, IsSolidAndNoThickerThanItsVoxelsNeed) {
  const WallScene wall({.thickness = 0.0,
                        .voxel = 0.004,
                        .tilt = {0.2, 0.1, 0.0},
                        .offset = {0.0, 0.001, 0.0017},
                        .refine = "[{from: [-0.03, -0.03, -0.03], to: [0.03, 0.03, 0.03]}]"});
  ASSERT_TRUE(wall.loaded()) << wall.loaded().error().what;
  const structures::DistanceField& field = wall.bay().field;
  const Vector3 half = Vector3::Constant(0.03);
  EXPECT_LE(field.largestDilation({-half, half}), 0.87 * 0.0005);
  EXPECT_GT(field.dilation(), 0.5 * 0.004) << "elsewhere";
  EXPECT_LE(field.slope(), 1.2);
  EXPECT_EQ(wall.bay().info.open_area, 0.0);
  for (const double speed : kSpeeds) {
    const WallScene::Push push = wall.push(speed);
    EXPECT_LE(push.behind, 0.00005) << speed << " m/s";
    EXPECT_GT(push.final_force, 10.0) << speed << " m/s";
  }
}

//   a solid is not thickened, from 2.5 voxels on, its rims and corners included
TEST(WallOfASolid, HasNoDilation) {
  for (const double thickness : {0.0125, 0.013, 0.014, 0.02, 0.03}) {
    for (const Vector3& tilt :
         {Vector3(0.0, 0.0, 0.0), Vector3(0.3, 0.1, 0.0), Vector3(0.61548, -0.61548, 0.0),
          Vector3(0.04, 0.07, 0.2), Vector3(-0.5, 0.2, 0.4), Vector3(-0.57, 0.03, 0.52),
          Vector3(-0.04, -0.08, 0.45)}) {
      SCOPED_TRACE(testing::Message() << thickness << " m, tilt " << tilt.transpose());
      const WallScene wall({.thickness = thickness, .voxel = 0.005, .clearance = 0.0005, .tilt = tilt});
      ASSERT_TRUE(wall.loaded()) << wall.loaded().error().what;
      EXPECT_EQ(wall.bay().field.dilation(), 0.0);
      EXPECT_EQ(wall.bay().field.slope(), 1.0);
      EXPECT_EQ(wall.bay().info.thin_area, 0.0);
      EXPECT_LE(wall.push(1.0).behind, 0.00005);
    }
  }
}

//   a sheet that lies in a plane of samples: at its surface, the field is exact
TEST(SheetOnSamples, IsThickened) {
  const WallScene wall({.thickness = 0.0, .voxel = 0.005});
  ASSERT_TRUE(wall.loaded()) << wall.loaded().error().what;
  EXPECT_NEAR(wall.bay().field.dilation(), 0.866 * 0.005, 1e-4);
  EXPECT_LE(wall.push(0.1).behind, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Thickness, WallBesideAClearance, testing::Values(0.0, 0.0005, 0.001, 0.002, 0.003),
                         [](const auto& one) { return std::to_string(std::lround(one.param * 1e6)) + "um"; });

}  // namespace
}  // namespace tenon::session
