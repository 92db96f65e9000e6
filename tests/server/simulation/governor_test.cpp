#include "server/simulation/governor.h"

#include <gtest/gtest.h>

namespace tenon::simulation {
namespace {

constexpr double kGoal = 0.7e-3;

TEST(Governor, SingleSlowTicksDoNotChangeTheBudget) {
  Governor governor(kGoal);
  for (int tick = 0; tick < 1000; ++tick) {
    const double seconds = tick % 50 == 0 ? 5e-3 : 1e-4;
    ASSERT_FALSE(governor.update(seconds, 10'000, 0)) << "tick " << tick;
  }
}

TEST(Governor, SlowTicksReduceTheBudgetToTheMeasuredRate) {
  Governor governor(kGoal);
  EXPECT_FALSE(governor.update(1.4e-3, 100'000, 0));
  EXPECT_FALSE(governor.update(1.4e-3, 100'000, 0));
  const auto budget = governor.update(1.4e-3, 100'000, 0);
  ASSERT_TRUE(budget);
  EXPECT_LT(*budget, 50'000U);
  EXPECT_GT(*budget, 25'000U);
}

TEST(Governor, ReducesTheBudgetAgainWhileTicksWithinItAreSlow) {
  Governor governor(kGoal);
  std::uint64_t budget = 40'000;
  for (int tick = 0; tick < 30; ++tick) {
    if (const auto next = governor.update(0.8e-3, budget, budget)) {
      EXPECT_LT(*next, budget);
      budget = *next;
    }
  }
  EXPECT_LT(budget, 10'000U);
  EXPECT_GE(budget, Governor::kMinBudget);
}

TEST(Governor, RaisesTheBudgetInFastTicksUntilItIsUnlimited) {
  Governor governor(kGoal);
  std::uint64_t budget = 20'000;
  int ticks = 0;
  for (; budget > 0 && ticks < 100'000; ++ticks) {
    if (const auto next = governor.update(1e-4, 5'000, budget)) {
      EXPECT_TRUE(*next > budget || *next == 0);
      budget = *next;
    }
  }
  EXPECT_EQ(budget, 0U);
  EXPECT_GT(ticks, 10'000) << "at most once in kFastTicks";
}

TEST(Governor, NeverGoesBelowTheMinimumBudget) {
  Governor governor(kGoal);
  std::uint64_t budget = 0;
  for (int tick = 0; tick < 1000; ++tick) budget = governor.update(1.0, 10, budget).value_or(budget);
  EXPECT_EQ(budget, Governor::kMinBudget);
}

TEST(Governor, SlowTicksDoNotRaiseABudgetBelowTheMinimum) {
  Governor governor(kGoal);
  for (int tick = 0; tick < 100; ++tick) EXPECT_EQ(governor.update(1.0, 10, 500).value_or(500), 500U);
}

}  // namespace
}  // namespace tenon::simulation
