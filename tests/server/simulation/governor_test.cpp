#include "server/simulation/governor.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr double kGoal = 0.7e-3;

TEST(Governor, OneSlowTickIsTheOperatingSystems) {
  Governor governor(kGoal);
  for (int tick = 0; tick < 1000; ++tick) {
    const double seconds = tick % 50 == 0 ? 5e-3 : 1e-4;
    ASSERT_FALSE(governor.judge(seconds, 10'000, 0)) << "tick " << tick;
  }
}

TEST(Governor, SlowTicksCutTheBudgetToWhatTheMachineCanDo) {
  Governor governor(kGoal);
  EXPECT_FALSE(governor.judge(1.4e-3, 100'000, 0));
  EXPECT_FALSE(governor.judge(1.4e-3, 100'000, 0));
  const auto budget = governor.judge(1.4e-3, 100'000, 0);
  ASSERT_TRUE(budget);
  EXPECT_LT(*budget, 50'000U);
  EXPECT_GT(*budget, 25'000U);
}

TEST(Governor, CutsAgainWhenTheBudgetWasKeptAndTicksAreSlowAllTheSame) {
  Governor governor(kGoal);
  std::uint64_t budget = 40'000;
  for (int tick = 0; tick < 30; ++tick) {
    if (const auto next = governor.judge(0.8e-3, budget, budget)) {
      EXPECT_LT(*next, budget);
      budget = *next;
    }
  }
  EXPECT_LT(budget, 10'000U);
  EXPECT_GE(budget, Governor::kLeastBudget);
}

TEST(Governor, GivesBackInCalmTimesUntilNothingIsLimited) {
  Governor governor(kGoal);
  std::uint64_t budget = 20'000;
  int ticks = 0;
  for (; budget > 0 && ticks < 100'000; ++ticks) {
    if (const auto next = governor.judge(1e-4, 5'000, budget)) {
      EXPECT_TRUE(*next > budget || *next == 0);
      budget = *next;
    }
  }
  EXPECT_EQ(budget, 0U);
  EXPECT_GT(ticks, 10'000) << "slowly";
}

TEST(Governor, NeverStarvesATick) {
  Governor governor(kGoal);
  std::uint64_t budget = 0;
  for (int tick = 0; tick < 1000; ++tick) budget = governor.judge(1.0, 10, budget).value_or(budget);
  EXPECT_EQ(budget, Governor::kLeastBudget);
}

TEST(Governor, ASmallBudgetThatSomebodyGaveIsNotRaisedBySlowTicks) {
  Governor governor(kGoal);
  for (int tick = 0; tick < 100; ++tick) EXPECT_EQ(governor.judge(1.0, 10, 500).value_or(500), 500U);
}

}  // namespace
}  // namespace tenon
