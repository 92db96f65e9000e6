#include "tests/server/simulation/overload.h"

#include <algorithm>
#include <map>

#include <gtest/gtest.h>

#include "server/simulation/governor.h"
#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

constexpr Tick kTicksOfOverload = 600;
constexpr int kBlocks = 6;
constexpr std::uint64_t kBudget = 20'000;

EnvironmentOptions withBudget(std::uint64_t points) {
  EnvironmentOptions options;
  options.work.points = points;
  return options;
}

/// [points] of each tick once all blocks lie on the floor, in ascending order.
std::vector<std::uint64_t> workOf(const test::Overload& overload, Environment& environment) {
  std::vector<std::uint64_t> work;
  while (environment.tick() < kTicksOfOverload) {
    overload.step(environment);
    if (environment.tick() > 100) work.push_back(environment.work().points_visited);
  }
  std::sort(work.begin(), work.end());
  return work;
}

std::uint64_t p99(const std::vector<std::uint64_t>& sorted) { return sorted[sorted.size() * 99 / 100]; }

TEST(Overload, TicksStayWithinTheirBudget) {
  const test::Overload overload(kBlocks);
  Environment unlimited(overload.scene, {});
  EXPECT_GT(p99(workOf(overload, unlimited)), 2 * kBudget);

  Environment limited(overload.scene, withBudget(kBudget));
  EXPECT_LE(p99(workOf(overload, limited)), kBudget);
  EXPECT_EQ(limited.work().limited_pairs, static_cast<std::uint32_t>(kBlocks));
}

// Skipped levels must not make a block sink, jump or stand still.
TEST(Overload, BlocksWithSkippedLevelsStayOnTheFloorAndFollowTheirHands) {
  const test::Overload overload(kBlocks);
  Environment unlimited(overload.scene, {});
  Environment limited(overload.scene, withBudget(kBudget));
  while (limited.tick() < kTicksOfOverload) {
    overload.step(unlimited);
    overload.step(limited);
    if (limited.tick() < 100) continue;
    for (const ObjectId part : overload.parts) {
      const Pose& X_WO = limited.objects()[part.value].X_WO;
      ASSERT_NEAR(X_WO.translation().z(), 0.02, 5e-5) << "tick " << limited.tick();
      const Pose& X_WO_unlimited = unlimited.objects()[part.value].X_WO;
      ASSERT_LT((X_WO.translation() - X_WO_unlimited.translation()).norm(), 2e-4)
          << "tick " << limited.tick();
      ASSERT_TRUE(limited.inContact(part, overload.floor));
    }
  }
}

TEST(Overload, SkippedLevelsDoNotOscillate) {
  const test::Overload overload(kBlocks);
  Environment environment(overload.scene, withBudget(kBudget));
  std::map<std::size_t, std::uint32_t> skipped_levels;
  int changes = 0;
  for (Tick tick = 0; tick < 2000; ++tick) {
    overload.step(environment);
    for (const std::size_t pair : overload.pairs) {
      const std::uint32_t now = environment.pairs()[pair].skipped_levels;
      if (tick > 100 && skipped_levels[pair] != now) ++changes;
      skipped_levels[pair] = now;
    }
  }
  EXPECT_LE(changes, 2 * kBlocks) << "in two seconds";
}

TEST(Overload, SkippedLevelsAreRestoredWithALargerBudget) {
  const test::Overload overload(kBlocks);
  Environment environment(overload.scene, withBudget(kBudget));
  while (environment.tick() < 200) overload.step(environment);
  ASSERT_GT(environment.work().limited_pairs, 0U);
  environment.setBudget(20 * kBudget);
  const Tick later = environment.tick() + 5000;
  while (environment.tick() < later && environment.work().limited_pairs > 0) overload.step(environment);
  EXPECT_EQ(environment.work().limited_pairs, 0U);
  environment.setBudget(kBudget);
  overload.step(environment);
  EXPECT_EQ(environment.work().limited_pairs, static_cast<std::uint32_t>(kBlocks))
      << "levels are skipped immediately";
  environment.setBudget(0);
  overload.step(environment);
  overload.step(environment);
  EXPECT_EQ(environment.work().limited_pairs, 0U) << "without a budget no level is skipped";
}

// The governor gets synthetic times that change the budget several times.
TEST(Overload, AGovernedRunIsReproducedFromItsBudgetsWithoutAClock) {
  const test::Overload overload(kBlocks);
  std::map<Tick, std::uint64_t> budgets;
  std::vector<std::uint64_t> hashes;
  {
    Environment environment(overload.scene, {});
    Governor governor(0.7e-3);
    std::uint64_t noise = 1;
    while (environment.tick() < kTicksOfOverload) {
      overload.step(environment);
      hashes.push_back(environment.hash());
      noise = noise * 6364136223846793005ULL + 1442695040888963407ULL;
      const double seconds = static_cast<double>(environment.work().points_visited) * 1e-8 *
                             (1.0 + 0.1 * static_cast<double>(noise >> 60U));
      const auto budget =
          governor.update(seconds, environment.work().points_visited, environment.workLimits().points);
      if (!budget) continue;
      budgets[environment.tick() + 1] = *budget;
      environment.setBudget(*budget);
    }
  }
  EXPECT_FALSE(budgets.empty());
  EnvironmentOptions two;
  two.workers = 2;
  Environment again(overload.scene, two);
  std::vector<std::uint64_t> hashes_again;
  while (again.tick() < kTicksOfOverload) {
    if (const auto budget = budgets.find(again.tick() + 1); budget != budgets.end())
      again.setBudget(budget->second);
    overload.step(again);
    hashes_again.push_back(again.hash());
  }
  EXPECT_EQ(hashes_again, hashes);
}

TEST(Overload, BudgetAndLevelsAreRestoredFromACheckpoint) {
  const test::Overload overload(3);
  Environment original(overload.scene, withBudget(kBudget / 4));
  while (original.tick() < 150) overload.step(original);
  Environment restored(overload.scene, {});
  ASSERT_TRUE(restored.restore(original.save()));
  EXPECT_EQ(restored.workLimits().points, kBudget / 4);
  while (original.tick() < 300) {
    overload.step(original);
    overload.step(restored);
    ASSERT_EQ(original.hash(), restored.hash()) << "tick " << original.tick();
  }
}

//      |  |
//    +------+     a block on a needle: only the finest shell level contains the needle's tip
//    +------+
//       \/
//   ~~~~~~~~~~~
TEST(Overload, PointsThatSupportABodyAreNotSkipped) {
  std::vector<structures::SurfaceSample> sites = test::boxSamples({0.1, 0.06, 0.04}, 0.002);
  sites.push_back({{0.0, 0.0, -0.025}, {0.0, 0.0, 1.0}, 1e-6});
  const auto needle = test::analyticStructures(
      test::boxDistance({0.1, 0.06, 0.04}),
      Eigen::AlignedBox3d(Vector3(-0.05, -0.03, -0.02), Vector3(0.05, 0.03, 0.02)), 0.004, sites, 0.002);
  test::SmallScene small;
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const ObjectId block = small.object("block", needle, {0.0, 0.0, 0.03});
  const HandId hand = small.hand("hand", block);
  const std::size_t pair = small.pair(block, floor);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {0.0, 0.0, 0.03});
  test::moveHandTo(environment, hand, {0.0, 0.0, 0.023}, 100);
  const auto height = [&] { return environment.objects()[block.value].X_WO.translation().z(); };
  ASSERT_NEAR(height(), 0.025, 5e-5);
  environment.setBudget(100);
  std::uint32_t skipped_levels = 0;
  for (int tick = 0; tick < 300; ++tick) {
    environment.setHandPose(hand, Pose(Vector3(2e-4 * tick, 0.0, 0.023)), {});
    environment.step();
    ASSERT_NEAR(height(), 0.025, 1e-4);
    skipped_levels = std::max(skipped_levels, environment.pairs()[pair].skipped_levels);
  }
  EXPECT_GT(skipped_levels, 0U);
  EXPECT_NE(environment.pairs()[pair].result, nullptr);
}

TEST(Overload, ALimitedTickAllocatesNothing) {
  const test::Overload overload(3);
  EnvironmentOptions options = withBudget(kBudget / 4);
  options.workers = 2;
  Environment environment(overload.scene, options);
  overload.step(environment);
  const test::RealtimeGuard guard(test::CountedThreads::kAll);
  while (environment.tick() < 200) {
    overload.step(environment);
    if (environment.tick() == 100) environment.setBudget(kBudget / 8);
    if (environment.tick() == 150) environment.setGroup(overload.parts[0], 3);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::simulation
