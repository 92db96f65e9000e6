#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using test::boxMesh;
using test::together;
using testing::HasSubstr;
using testing::Not;

constexpr double kGapVoxel = 0.003;

structures::HapticStructures bakedWithGaps(const TriangleMesh& mesh, int refinement) {
  auto structures = bake(mesh, {.voxel = kGapVoxel, .refinement = refinement, .points = 500});
  EXPECT_TRUE(structures) << structures.error().what;
  return structures.value_or(structures::HapticStructures{});
}

double bytesOf(const structures::HapticStructures& structures) {
  const structures::DistanceField::Layout& layout = structures.field.layout();
  return static_cast<double>(layout.samples.size_bytes() + layout.index.size_bytes() +
                             layout.far.size_bytes());
}

/// A slab of 200 mm with its top at z = 0, large enough that a few bricks may be refined.
TriangleMesh slab() { return boxMesh({-0.2, -0.2, -0.04}, {0.2, 0.2, 0.0}); }

/// Two blocks of 20 mm on the slab at x = `at` [m], `gap` [m] apart.
TriangleMesh blocksApart(double at, double gap) {
  return together(boxMesh({at - 0.02, -0.01, -0.01}, {at - gap / 2, 0.01, 0.02}),
                  boxMesh({at + gap / 2, -0.01, -0.01}, {at + 0.02, 0.01, 0.02}));
}

//      ## ##      a gap of 2 mm in voxels of 3 mm: the coarse field closes it, with the default refinement it
//      is open
//   ###########
TEST(AirGaps, AreOpenedWithinHalfOfTheBytes) {
  const TriangleMesh mesh = together(slab(), blocksApart(0.0, 0.002));
  const structures::HapticStructures coarse = bakedWithGaps(mesh, 1);
  const structures::HapticStructures fine = bakedWithGaps(mesh, 4);
  const Vector3 in_gap(0.0, 0.001, 0.012);
  EXPECT_LT(coarse.field.sample(in_gap).distance, 0.0002);
  EXPECT_GT(fine.field.sample(in_gap).distance, 0.0006) << "1 mm, less what interpolation cuts off";
  EXPECT_NEAR(fine.field.voxelAt(in_gap), kGapVoxel / 4, 1e-12);
  EXPECT_LE(bytesOf(fine), 1.5 * bytesOf(coarse));
  EXPECT_THAT(fine.info.notes, HasSubstr("places with gaps below two voxels are refined"));
  EXPECT_THAT(fine.info.notes, Not(HasSubstr("not resolved")));
}

//   ## ##   ##  ##   ...: more than half of the bytes allow: the narrowest are refined, the others are said
TEST(AirGaps, TheNarrowestAreRefinedAndTheOthersReported) {
  TriangleMesh mesh = slab();
  const std::array<double, 7> gaps{0.005, 0.0045, 0.004, 0.0018, 0.0042, 0.0035, 0.0048};
  for (std::size_t i = 0; i < gaps.size(); ++i)
    mesh = together(mesh, blocksApart(-0.15 + 0.05 * static_cast<double>(i), gaps[i]));
  const structures::HapticStructures coarse = bakedWithGaps(mesh, 1);
  const structures::HapticStructures fine = bakedWithGaps(mesh, 4);
  EXPECT_LE(bytesOf(fine), 1.5 * bytesOf(coarse));
  EXPECT_LT(fine.field.voxelAt({0.0, 0.001, 0.012}), kGapVoxel) << "1.8 mm";
  EXPECT_EQ(fine.field.voxelAt({-0.15, 0.001, 0.012}), kGapVoxel) << "5 mm";
  EXPECT_THAT(fine.info.notes, HasSubstr("places with gaps below two voxels are refined"));
  EXPECT_THAT(fine.info.notes, HasSubstr("not resolved, the narrowest"));
}

// what is narrow, but no air: a wall, solids that overlap, an inner corner, a closed cavity
TEST(AirGaps, AreOfAirBetweenSurfacesThatFaceEachOther) {
  for (const TriangleMesh& mesh :
       {together(slab(), boxMesh({-0.05, -0.0005, -0.01}, {0.05, 0.0005, 0.05})),
        together(slab(), boxMesh({-0.05, -0.05, -0.002}, {0.05, 0.05, 0.05})),
        together(slab(), boxMesh({-0.05, -0.05, -0.03}, {-0.03, -0.03, -0.028}))}) {
    const structures::HapticStructures fine = bakedWithGaps(mesh, 4);
    EXPECT_THAT(fine.info.notes, Not(HasSubstr("gaps")));
    EXPECT_EQ(fine.field.layout().refinement, 1);
  }
}

}  // namespace
}  // namespace tenon::bake
