#include "clients/haptic/force_age_statistics.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr std::int64_t kMillisecondOfAge = 1'000'000;  // [ns]
constexpr double kBin = 50e-6;                         // [s]

TEST(DurationHistogram, QuantilesAreExactToOneBin) {
  DurationHistogram durations;
  EXPECT_EQ(durations.quantile(0.5), 0.0) << "empty";
  for (int i = 1; i <= 100; ++i) durations.add(i * kMillisecondOfAge / 10);
  EXPECT_EQ(durations.count(), 100U);
  EXPECT_NEAR(durations.quantile(0.5), 5e-3, 2 * kBin + 1e-4);
  EXPECT_NEAR(durations.quantile(0.99), 9.9e-3, 2 * kBin + 1e-4);
  EXPECT_DOUBLE_EQ(durations.max(), 10e-3);
}

TEST(DurationHistogram, TheMaximumIsExactBeyondTheLastBin) {
  DurationHistogram durations;
  durations.add(-5);
  durations.add(3000 * kMillisecondOfAge);
  EXPECT_DOUBLE_EQ(durations.max(), 3.0);
  EXPECT_GE(durations.quantile(0.9), 0.1);
}

TEST(DurationHistogram, LongDurationsAreExactToTwoPercent) {
  DurationHistogram durations;
  for (int i = 0; i < 100; ++i) durations.add(i < 90 ? 150 * kMillisecondOfAge : 4000 * kMillisecondOfAge);
  EXPECT_NEAR(durations.quantile(0.5), 0.15, 0.02 * 0.15);
  EXPECT_NEAR(durations.quantile(0.99), 4.0, 0.02 * 4.0);
  EXPECT_DOUBLE_EQ(durations.min(), 0.15);
  durations.clear();
  EXPECT_EQ(durations.count(), 0U);
}

TEST(AnswerLoss, IsThatOfTheHandThatLostMost) {
  AnswerLoss loss;
  EXPECT_EQ(loss.share(), 0.0);
  for (Tick tick = 1; tick <= 100; ++tick) {
    if (tick % 10 != 5) loss.received(HandId{0}, tick);
    if (tick % 10 == 0) loss.received(HandId{7}, tick);  // a tracked limb
    if (tick > 3) loss.received(HandId{0}, 3);           // again
  }
  EXPECT_NEAR(loss.share(), 0.1, 1e-9);
  loss.clear();
  EXPECT_EQ(loss.share(), 0.0);
}

TEST(AnswerLoss, OfSlowAnswersIsThatOfThoseInTurn) {
  AnswerLoss loss;
  for (Tick tick = 1; tick <= 10'000; ++tick) {
    const bool is_in_turn = tick % AnswerLoss::kSlowTicks == 0, is_lost = tick % 200 == 0;
    const bool is_out_of_turn = tick % 40 == 3 || tick % 40 == 5;
    if ((is_in_turn && !is_lost) || is_out_of_turn) loss.received(HandId{0}, tick);
  }
  EXPECT_NEAR(loss.share(), 0.1, 0.005);
}

//  input     1   2   3            each answered after 2 ms; the second answer to 2 is from the other hand
//  answer            1   2 2 3
TEST(ForceAgeStatistics, CountsTheTimeFromAnInputToItsFirstAnswerOnce) {
  ForceAgeStatistics age;
  for (std::uint32_t seq = 1; seq <= 10; ++seq)
    age.inputSent(seq, seq * kMillisecondOfAge, kMillisecondOfAge);
  for (std::uint32_t seq = 1; seq <= 10; ++seq) {
    age.answerReceived(HandId{0}, seq, seq, (seq + 2) * kMillisecondOfAge);
    age.answerReceived(HandId{1}, seq, seq, (seq + 7) * kMillisecondOfAge);
  }
  age.answerReceived(HandId{0}, 1, 2, 100 * kMillisecondOfAge);
  age.answerReceived(HandId{0}, 1, 0, 100 * kMillisecondOfAge);
  age.answerReceived(HandId{0}, 1, 4711, 100 * kMillisecondOfAge);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 10U);
  EXPECT_NEAR(telemetry.input_to_force_p50, 2e-3, 2 * kBin);
  EXPECT_DOUBLE_EQ(telemetry.input_to_force_max, 2e-3);
  EXPECT_LE(telemetry.loop_late_p99, kBin) << "the loop was on time";
  EXPECT_NEAR(telemetry.age, 2e-3, 2 * kBin);
  EXPECT_EQ(telemetry.answers_lost, 0.0);
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 10U);
  EXPECT_EQ(telemetry.age, 0.0) << "none since the last one";
}

//  input     1   2   3   4   5    answered at once but for 3, whose answer comes with that of 4: 2 periods
TEST(ForceAgeStatistics, KeepsTheLongestTimeWithoutANewerAnswer) {
  ForceAgeStatistics age;
  for (std::uint32_t seq = 1; seq <= 5; ++seq) age.inputSent(seq, seq * kMillisecondOfAge, kMillisecondOfAge);
  for (const std::uint32_t seq : {1, 2, 4, 3, 5})
    age.answerReceived(HandId{0}, seq, seq, std::max(seq, 2U) * kMillisecondOfAge);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_DOUBLE_EQ(telemetry.longest_silence, 2e-3);
}

}  // namespace
}  // namespace tenon::haptic
