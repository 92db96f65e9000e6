#include "clients/haptic/force_age.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]
constexpr double kBin = 50e-6;                    // [s]

TEST(DurationHistogram, QuantilesAreRightToABin) {
  DurationHistogram durations;
  EXPECT_EQ(durations.quantile(0.5), 0.0) << "of nothing";
  for (int i = 1; i <= 100; ++i) durations.add(i * kMillisecond / 10);
  EXPECT_EQ(durations.count(), 100U);
  EXPECT_NEAR(durations.quantile(0.5), 5e-3, 2 * kBin + 1e-4);
  EXPECT_NEAR(durations.quantile(0.99), 9.9e-3, 2 * kBin + 1e-4);
  EXPECT_DOUBLE_EQ(durations.longest(), 10e-3);
}

TEST(DurationHistogram, WhatIsBeyondTheLastBinIsKeptAsTheLongest) {
  DurationHistogram durations;
  durations.add(-5);
  durations.add(3000 * kMillisecond);
  EXPECT_DOUBLE_EQ(durations.longest(), 3.0);
  EXPECT_GE(durations.quantile(0.9), 0.1);
}

//  reading   1   2   3            each answered 2 ms later; the second answer to 2 is of the other hand
//  answer            1   2 2 3
TEST(ForceAge, CountsTheTimeFromAReadingToItsFirstAnswerOnce) {
  ForceAge age;
  for (std::uint32_t seq = 1; seq <= 10; ++seq) age.sent(seq, seq * kMillisecond, kMillisecond);
  for (std::uint32_t seq = 1; seq <= 10; ++seq) {
    age.answered(seq, (seq + 2) * kMillisecond);
    age.answered(seq, (seq + 7) * kMillisecond);
  }
  age.answered(2, 100 * kMillisecond);
  age.answered(0, 100 * kMillisecond);
  age.answered(4711, 100 * kMillisecond);
  Telemetry told;
  age.fill(told);
  EXPECT_EQ(told.samples, 10U);
  EXPECT_NEAR(told.input_to_force_p50, 2e-3, 2 * kBin);
  EXPECT_DOUBLE_EQ(told.input_to_force_max, 2e-3);
  EXPECT_LE(told.loop_late_p99, kBin) << "the loop was on time";
}

}  // namespace
}  // namespace tenon
