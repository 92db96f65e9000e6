#include "server/structures/shell_builder.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::structures {
namespace {

/// Evenly distributed samples of the unit sphere (Fibonacci lattice).
std::vector<SurfaceSample> sphereSamples(int count) {
  std::vector<SurfaceSample> samples;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double angle = 2.399963229728653 * i;
    const double r = std::sqrt(1.0 - z * z);
    const Vector3 p(r * std::cos(angle), r * std::sin(angle), z);
    samples.push_back({p, -p, 4.0 * std::numbers::pi / count});
  }
  return samples;
}

TEST(ShellBuilder, EveryPrefixOfLevelsSamplesTheWholeObject) {
  const std::vector<SurfaceSample> samples = sphereSamples(5000);
  const Pointshell shell = buildShell(samples);
  ASSERT_GE(shell.levels().size(), 4U);
  std::uint32_t used = 0;
  for (const ShellLevel& level : shell.levels()) {
    ASSERT_EQ(level.first_point, used);
    used += level.point_count;
    // no point of the surface is further from a used point than the level's spacing
    for (std::size_t i = 0; i < samples.size(); i += 7) {
      double nearest = 10.0;
      for (std::uint32_t k = 0; k < used; ++k) {
        nearest = std::min(nearest, (shell.points()[k].p_MP.cast<double>() - samples[i].p_MP).norm());
      }
      EXPECT_LE(nearest, level.spacing * 1.001) << "with " << used << " points";
    }
  }
  EXPECT_EQ(used, 5000U);
}

TEST(ShellBuilder, AreasOfEveryPrefixAddUpToTheWholeSurface) {
  const Pointshell shell = buildShell(sphereSamples(3000));
  ASSERT_GT(shell.levels().size(), 2U);
  double sum = 0.0;
  for (const ShellLevel& level : shell.levels()) {
    for (std::uint32_t k = 0; k < level.point_count; ++k) sum += shell.points()[level.first_point + k].area;
    EXPECT_NEAR(sum * level.area_scale, 4.0 * std::numbers::pi, 1e-3);
  }
}

TEST(ShellBuilder, SpheresBoundTheirLeavesAndPoints) {
  const Pointshell shell = buildShell(sphereSamples(3001));
  std::size_t points_seen = 0;
  for (const ShellSphere& cluster : shell.clusters()) {
    ASSERT_LE(cluster.count, Pointshell::kClusterLeaves);
    for (const ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
      ASSERT_LE(leaf.count, Pointshell::kLeafPoints);
      for (const ShellPoint& point : shell.points().subspan(leaf.first, leaf.count)) {
        ++points_seen;
        EXPECT_LE((point.p_MP - leaf.p_MC).norm(), leaf.radius);
        EXPECT_LE((point.p_MP - cluster.p_MC).norm(), cluster.radius);
        const auto number = static_cast<std::size_t>(&point - shell.points().data());
        EXPECT_EQ(shell.leafOf(number), &leaf - shell.leaves().data());
      }
    }
  }
  EXPECT_EQ(points_seen, 3001U);
}

TEST(ShellBuilder, BothSidesOfAThinPlateKeepTheirPoints) {
  // a plate 1 mm thick, points 10 mm apart on each side
  std::vector<SurfaceSample> samples;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 20; ++k) {
      for (const double side : {-1.0, 1.0}) {
        samples.push_back({Vector3(0.01 * i, 0.01 * k, 0.0005 * side), Vector3(0.0, 0.0, -side), 1e-4});
      }
    }
  }
  const Pointshell shell = buildShell(samples);
  const ShellLevel& coarsest = shell.levels()[0];
  int upper = 0;
  for (std::uint32_t k = 0; k < coarsest.point_count; ++k) {
    if (shell.points()[k].inward_M.z() < 0.0F) ++upper;
  }
  EXPECT_NEAR(upper, coarsest.point_count / 2.0, coarsest.point_count * 0.1);
}

TEST(ShellBuilder, OnePointGivesAShellAndNoPointAnEmptyOne) {
  const Pointshell one = buildShell(sphereSamples(1));
  EXPECT_EQ(one.points().size(), 1U);
  EXPECT_EQ(one.levels().size(), 1U);
  EXPECT_TRUE(buildShell({}).empty());
}

TEST(ShellBuilder, HasTheBoundingSphereOfItsPoints) {
  std::vector<SurfaceSample> samples = sphereSamples(500);
  for (SurfaceSample& sample : samples) sample.p_MP += Vector3(3.0, 0.0, 0.0);
  const Pointshell shell = buildShell(samples);
  EXPECT_NEAR(shell.radius(), 4.0, 0.02);
  EXPECT_NEAR(shell.boundingRadius(), 1.0, 0.02);
  EXPECT_NEAR(shell.boundingCentre().x(), 3.0, 0.02);
}

}  // namespace
}  // namespace tenon::structures
