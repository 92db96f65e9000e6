#include "clients/haptic/force_age_statistics.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]
constexpr double kBin = 50e-6;                    // [s]

TEST(DurationHistogram, QuantilesAreExactToOneBin) {
  DurationHistogram durations;
  EXPECT_EQ(durations.quantile(0.5), 0.0) << "empty";
  for (int i = 1; i <= 100; ++i) durations.add(i * kMillisecond / 10);
  EXPECT_EQ(durations.count(), 100U);
  EXPECT_NEAR(durations.quantile(0.5), 5e-3, 2 * kBin + 1e-4);
  EXPECT_NEAR(durations.quantile(0.99), 9.9e-3, 2 * kBin + 1e-4);
  EXPECT_DOUBLE_EQ(durations.max(), 10e-3);
}

TEST(DurationHistogram, TheMaximumIsExactBeyondTheLastBin) {
  DurationHistogram durations;
  durations.add(-5);
  durations.add(3000 * kMillisecond);
  EXPECT_DOUBLE_EQ(durations.max(), 3.0);
  EXPECT_GE(durations.quantile(0.9), 0.1);
}

//  input     1   2   3            each answered after 2 ms; the second answer to 2 is from the other hand
//  answer            1   2 2 3
TEST(ForceAgeStatistics, CountsTheTimeFromAnInputToItsFirstAnswerOnce) {
  ForceAgeStatistics age;
  for (std::uint32_t seq = 1; seq <= 10; ++seq) age.inputSent(seq, seq * kMillisecond, kMillisecond);
  for (std::uint32_t seq = 1; seq <= 10; ++seq) {
    age.answerReceived(seq, (seq + 2) * kMillisecond);
    age.answerReceived(seq, (seq + 7) * kMillisecond);
  }
  age.answerReceived(2, 100 * kMillisecond);
  age.answerReceived(0, 100 * kMillisecond);
  age.answerReceived(4711, 100 * kMillisecond);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 10U);
  EXPECT_NEAR(telemetry.input_to_force_p50, 2e-3, 2 * kBin);
  EXPECT_DOUBLE_EQ(telemetry.input_to_force_max, 2e-3);
  EXPECT_LE(telemetry.loop_late_p99, kBin) << "the loop was on time";
}

}  // namespace
}  // namespace tenon::haptic
