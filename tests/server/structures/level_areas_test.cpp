#include "server/structures/level_areas.h"

#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/analytic_structures.h"

namespace tenon::structures {
namespace {

double sumOf(std::span<const float> areas) { return std::accumulate(areas.begin(), areas.end(), 0.0); }

TEST(LevelAreas, AreasOfEachPrefixOfLevelsAddUpToTheWholeSurface) {
  const auto ball = test::sphereStructures(0.05, 0.004, 0.002);
  const Pointshell& shell = ball->shell;
  ASSERT_GE(shell.levels().size(), 3U);
  const double surface = 4.0 * 3.14159265358979 * 0.05 * 0.05;
  for (std::size_t k = 0; k < shell.levels().size(); ++k) {
    const ShellLevel& level = shell.levels()[k];
    EXPECT_EQ(shell.areasOfLevel(k).size(), level.first_point + level.point_count);
    EXPECT_NEAR(sumOf(shell.areasOfLevel(k)), surface, 1e-3 * surface);
  }
}

TEST(LevelAreas, WithAllLevelsPointsHaveTheirOwnArea) {
  const auto box = test::boxStructures({0.06, 0.04, 0.02}, 0.004, 0.002);
  const Pointshell& shell = box->shell;
  const auto areas = shell.areasOfLevel(shell.levels().size() - 1);
  for (std::size_t i = 0; i < areas.size(); ++i) ASSERT_EQ(areas[i], shell.points()[i].area);
}

// Coarse levels prefer corners and edges, which have little area: one factor per level would make faces too
// weak.
TEST(LevelAreas, OppositeFacesOfABoxHaveTheSameAreaAtEachLevel) {
  const Vector3 size(0.06, 0.04, 0.02);
  const auto box = test::boxStructures(size, 0.004, 0.001);
  const Pointshell& shell = box->shell;
  ASSERT_GT(shell.levels().size(), 2U);
  for (std::size_t k = 1; k < shell.levels().size(); ++k) {
    const auto areas = shell.areasOfLevel(k);
    double top = 0.0;
    double bottom = 0.0;
    for (std::size_t i = 0; i < areas.size(); ++i) {
      if (shell.points()[i].inward_M.z() < -0.9F) top += areas[i];
      if (shell.points()[i].inward_M.z() > 0.9F) bottom += areas[i];
    }
    EXPECT_GT(top, 0.0);
    EXPECT_NEAR(top, bottom, 0.1 * top) << "levels 0 to " << k;
  }
}

TEST(LevelAreas, AreaIsNotMovedToTheOtherSideOfAPlate) {
  std::vector<SurfaceSample> samples;
  for (int side = -1; side <= 1; side += 2) {
    for (int i = 0; i < 60; ++i) {
      for (int j = 0; j < 60; ++j) {
        const Vector3 p(0.001 * i, 0.001 * j, 0.0002 * side);
        samples.push_back({p, Vector3(0, 0, -side), side > 0 ? 2e-6 : 1e-6});
      }
    }
  }
  const Pointshell shell = buildShell(samples, 0.001);
  ASSERT_GE(shell.levels().size(), 3U);
  double upper = 0.0;
  const auto areas = shell.areasOfLevel(0);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    if (shell.points()[i].inward_M.z() < 0.0F) upper += areas[i];
  }
  EXPECT_NEAR(upper, 2.0 / 3.0 * sumOf(areas), 0.01 * upper);
}

}  // namespace
}  // namespace tenon::structures
