#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

structures::HapticStructures bakedShell(const TriangleMesh& mesh, std::uint32_t points,
                                        double voxel = 0.003) {
  BakeOptions options;
  options.voxel = voxel;
  options.points = points;
  auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures.value_or(structures::HapticStructures{});
}

double totalArea(const structures::Pointshell& shell) {
  double sum = 0.0;
  for (const structures::ShellPoint& point : shell.points()) sum += point.area;
  return sum;
}

TEST(ShellBake, SpreadsAboutTheRequestedNumberOfPointsEvenly) {
  const structures::HapticStructures structures = bakedShell(test::ballMesh(0.05, 5), 3000);
  const auto points = structures.shell.points();
  EXPECT_NEAR(static_cast<double>(points.size()), 3000.0, 450.0);
  const double mean_area = 4.0 * std::numbers::pi * 0.05 * 0.05 / static_cast<double>(points.size());
  for (const structures::ShellPoint& point : points) {
    EXPECT_GT(point.area, 0.3 * mean_area);
    EXPECT_LT(point.area, 2.5 * mean_area);
  }
  EXPECT_NEAR(totalArea(structures.shell), 4.0 * std::numbers::pi * 0.05 * 0.05, 1e-4);
}

TEST(ShellBake, NormalsPointIntoTheSolidForAnyWinding) {
  const TriangleMesh mesh = test::randomlyFlipped(test::ballMesh(0.05, 5), 3);
  const structures::HapticStructures structures = bakedShell(mesh, 2000);
  ASSERT_GT(structures.shell.points().size(), 1000U);
  for (const structures::ShellPoint& point : structures.shell.points()) {
    EXPECT_LT((point.inward_M + point.p_MP.normalized()).norm(), 0.15F);
  }
}

TEST(ShellBake, SkipsWallsInsideAUnion) {
  const structures::HapticStructures structures =
      bakedShell(test::together(test::boxMesh(Vector3(0, 0, 0), Vector3(0.08, 0.08, 0.08)),
                                test::boxMesh(Vector3(0.05, 0.02, 0.02), Vector3(0.13, 0.06, 0.06))),
                 3000);
  for (const structures::ShellPoint& point : structures.shell.points()) {
    const Vector3f& p = point.p_MP;
    const bool hidden_by_first = p.x() < 0.076F && (p.array() > 0.004F).all() && (p.array() < 0.076F).all();
    EXPECT_FALSE(hidden_by_first) << p.transpose();
  }
  const double outer = 6 * 0.08 * 0.08 + 4 * 0.05 * 0.04;
  EXPECT_NEAR(structures.info.surface_area, outer, 0.05 * outer);
}

TEST(ShellBake, PutsPointsOnCornersAndAlongConvexEdges) {
  const structures::HapticStructures structures =
      bakedShell(test::boxMesh(Vector3(0, 0, 0), Vector3(0.05, 0.04, 0.03)), 1500);
  int corners = 0;
  int on_edge = 0;
  for (const structures::ShellPoint& point : structures.shell.points()) {
    int extremes = 0;
    const Vector3f size(0.05F, 0.04F, 0.03F);
    for (int axis = 0; axis < 3; ++axis) {
      if (std::min(std::abs(point.p_MP[axis]), std::abs(point.p_MP[axis] - size[axis])) < 1e-6F) ++extremes;
    }
    if (extremes == 3) ++corners;
    if (extremes == 2) ++on_edge;
  }
  EXPECT_EQ(corners, 8);
  const double spacing = std::sqrt(structures.info.surface_area / 1500.0);
  EXPECT_GT(on_edge, 0.5 * 4 * 0.12 / spacing);
}

TEST(ShellBake, BothSidesOfAThinPlateHavePoints) {
  const structures::HapticStructures structures =
      bakedShell(test::boxMesh(Vector3(-0.05, -0.05, 0.0), Vector3(0.05, 0.05, 0.001)), 1000);
  int up = 0;
  int down = 0;
  for (const structures::ShellPoint& point : structures.shell.points()) {
    if (point.inward_M.z() < -0.9F) ++up;
    if (point.inward_M.z() > 0.9F) ++down;
  }
  EXPECT_GT(up, 200);
  EXPECT_GT(down, 200);
}

TEST(ShellBake, ASheetHasPointsToo) {
  const structures::HapticStructures structures = bakedShell(test::sheetMesh(0.05, 0.0, 5), 500);
  EXPECT_GT(structures.shell.points().size(), 350U);
  for (const structures::ShellPoint& point : structures.shell.points()) {
    EXPECT_NEAR(point.inward_M.norm(), 1.0F, 1e-5F);
  }
}

TEST(ShellBake, AreasOfEachPrefixOfLevelsAddUpToTheWholeSurface) {
  const structures::Pointshell shell = bakedShell(test::ballMesh(0.05, 4), 3000).shell;
  ASSERT_GT(shell.levels().size(), 2U);
  double sum = 0.0;
  for (const structures::ShellLevel& level : shell.levels()) {
    for (std::uint32_t k = 0; k < level.point_count; ++k) sum += shell.points()[level.first_point + k].area;
    EXPECT_NEAR(sum * level.area_scale, totalArea(shell), 1e-6);
  }
}

}  // namespace
}  // namespace tenon::bake
