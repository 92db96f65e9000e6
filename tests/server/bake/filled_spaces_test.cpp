#include <vector>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using structures::FilledSpace;
using test::boxMesh;
using test::together;

constexpr double kSpaceVoxel = 0.003;

std::vector<FilledSpace> filledIn(const TriangleMesh& mesh, const std::vector<RefineBox>& refine = {}) {
  BakeOptions options;
  options.voxel = kSpaceVoxel;
  options.refinement = refine.empty() ? 1 : 4;
  options.refine = refine;
  options.points = 500;
  const auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures ? structures->info.filled : std::vector<FilledSpace>();
}

/// The walls of a box as seen from inside.
TriangleMesh wallsFacingInwards(const Vector3& from, const Vector3& to) {
  TriangleMesh mesh = boxMesh(from, to);
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  return mesh;
}

void expectBox(const FilledSpace& space, const Vector3& from, const Vector3& to, double tolerance) {
  EXPECT_LE((Vector3f::Map(space.low.data()).cast<double>() - from).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LE((Vector3f::Map(space.high.data()).cast<double>() - to).cwiseAbs().maxCoeff(), tolerance);
}

//    ___________
//   |  _        |
//   | |_|  ___  |   6 x (10 mm)^2 and 6 x (20 mm)^2 of walls
//   |     |   | |
//   |     |___| |
//   |___________|
TEST(FilledSpaces, AreClosedVoidsWithTheirPlaceAndWalls) {
  const TriangleMesh block = boxMesh(Vector3::Constant(-0.03), Vector3::Constant(0.03));
  const TriangleMesh both =
      together(together(block, wallsFacingInwards(Vector3::Constant(-0.02), Vector3::Constant(-0.01))),
               wallsFacingInwards(Vector3::Constant(0.005), Vector3::Constant(0.025)));
  const std::vector<FilledSpace> filled = filledIn(both);
  ASSERT_EQ(filled.size(), 2U);
  EXPECT_NEAR(filled[0].wall_area, 6 * 4e-4, 1e-9);
  expectBox(filled[0], Vector3::Constant(0.005), Vector3::Constant(0.025), 1e-6);
  EXPECT_NEAR(filled[1].wall_area, 6e-4, 1e-9);
  expectBox(filled[1], Vector3::Constant(-0.02), Vector3::Constant(-0.01), 1e-6);
  EXPECT_TRUE(filledIn(block).empty());
  // no void, but a second block in the first
  EXPECT_TRUE(filledIn(together(block, boxMesh(Vector3::Constant(-0.02), Vector3::Constant(-0.01)))).empty());
}

/// Two blocks of 40 x 60 x 40 mm side by side on one of 20 mm.
TriangleMesh slotted(double width) {
  return together(together(boxMesh({-0.04, -0.03, -0.02}, {-width / 2, 0.03, 0.02}),
                           boxMesh({width / 2, -0.03, -0.02}, {0.04, 0.03, 0.02})),
                  boxMesh({-0.04, -0.03, -0.04}, {0.04, 0.03, -0.019}));
}

TEST(FilledSpaces, AreSlotsTooNarrowForTheirVoxels) {
  for (const double width : {0.0005, 0.001}) {
    const std::vector<FilledSpace> filled = filledIn(slotted(width));
    ASSERT_EQ(filled.size(), 1U) << width;
    // balls of voxels reach into the three sides that are open
    constexpr double kOpened = 3.0 * kSpaceVoxel;
    EXPECT_LE(filled[0].wall_area, 2 * 0.06 * 0.039);
    EXPECT_GE(filled[0].wall_area, 2 * (0.06 - 2 * kOpened) * (0.039 - kOpened));
    expectBox(filled[0], {-width / 2, -0.03, -0.019}, {width / 2, 0.03, 0.02}, kOpened);
    EXPECT_NEAR(filled[0].low[0], -width / 2, 1e-6);
    EXPECT_NEAR(filled[0].high[0], width / 2, 1e-6);
  }
  EXPECT_TRUE(filledIn(slotted(3.0 * kSpaceVoxel)).empty());
}

TEST(FilledSpaces, AreNotSlotsThatRefinementOpens) {
  const TriangleMesh mesh = slotted(0.8 * kSpaceVoxel);
  EXPECT_EQ(filledIn(mesh).size(), 1U);
  const Eigen::AlignedBox3d slot(Vector3(-0.003, -0.035, -0.025), Vector3(0.003, 0.035, 0.025));
  EXPECT_TRUE(filledIn(mesh, {{.box_M = slot}}).empty());
}

TEST(FilledSpaces, AreNotTheInsideOfOverlappingOrTouchingSolids) {
  const TriangleMesh post = boxMesh({-0.01, -0.01, -0.01}, {0.01, 0.01, 0.06});
  EXPECT_TRUE(filledIn(together(boxMesh({-0.05, -0.02, -0.02}, {0.05, 0.02, 0.02}), post)).empty());
  EXPECT_TRUE(filledIn(together(boxMesh({-0.05, -0.02, -0.05}, {0.05, 0.02, -0.01}), post)).empty());
  // 10 um apart, as CAD has it
  EXPECT_TRUE(filledIn(together(boxMesh({-0.05, -0.02, -0.05}, {0.05, 0.02, -0.01001}), post)).empty());
}

}  // namespace
}  // namespace tenon::bake
