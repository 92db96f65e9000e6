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

HandManifold answer(HandId hand, Tick tick, std::uint32_t seq, std::uint32_t epoch = 1) {
  return {.hand = hand, .server_epoch = epoch, .tick = tick, .answers_seq = seq};
}

//  cycle      1     2       3     answers 2 and 3 come in one cycle, 4 after 5
//  answers    1     2 3     5 4
TEST(ReplacedAnswers, AreThoseThatANewerOneReplacedBeforeACycleUsedThem) {
  ReplacedAnswers replaced;
  EXPECT_EQ(replaced.take(), 0.0);
  replaced.received(HandId{0}, 1, 1, 1);
  replaced.received(HandId{0}, 1, 2, 2);
  replaced.received(HandId{0}, 1, 3, 2);
  replaced.received(HandId{0}, 1, 5, 3);
  replaced.received(HandId{0}, 1, 4, 3);
  replaced.received(HandId{0}, 1, 5, 3);  // again
  replaced.received(HandId{1}, 1, 1, 3);
  EXPECT_DOUBLE_EQ(replaced.take(), 2.0 / 5.0);
  EXPECT_EQ(replaced.take(), 0.0);
  for (Tick tick = 1; tick <= 3; ++tick)
    replaced.received(HandId{0}, 2, tick, 10 + static_cast<std::int64_t>(tick));
  EXPECT_EQ(replaced.take(), 0.0) << "ticks of another life of the server are no earlier ones";
}

//  input     1   2   3            each answered after 2 ms; the second answer to 2 is from the other hand
//  answer            1   2 2 3
TEST(ForceAgeStatistics, CountsTheTimeFromAnInputToItsFirstAnswerOnce) {
  ForceAgeStatistics age;
  for (std::uint32_t seq = 1; seq <= 10; ++seq)
    age.inputSent(seq, seq * kMillisecondOfAge, kMillisecondOfAge);
  for (std::uint32_t seq = 1; seq <= 10; ++seq) {
    age.answerReceived(answer(HandId{0}, seq, seq), (seq + 2) * kMillisecondOfAge);
    age.answerReceived(answer(HandId{1}, seq, seq), (seq + 7) * kMillisecondOfAge);
  }
  age.answerReceived(answer(HandId{0}, 1, 2), 100 * kMillisecondOfAge);
  age.answerReceived(answer(HandId{0}, 1, 0), 100 * kMillisecondOfAge);
  age.answerReceived(answer(HandId{0}, 1, 4711), 100 * kMillisecondOfAge);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 10U);
  EXPECT_NEAR(telemetry.input_to_force_p50, 2e-3, 2 * kBin);
  EXPECT_DOUBLE_EQ(telemetry.input_to_force_max, 2e-3);
  EXPECT_LE(telemetry.loop_late_p99, kBin) << "the loop was on time";
  EXPECT_NEAR(telemetry.age, 2e-3, 2 * kBin);
  EXPECT_DOUBLE_EQ(telemetry.answers_replaced, 3.0 / 13.0) << "those of tick 1 that came after tick 10";
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 10U);
  EXPECT_EQ(telemetry.age, 0.0) << "none since the last one";
}

//  input     1   2   3   4   5    answered at once but for 3, whose answer comes with that of 4: 2 periods
TEST(ForceAgeStatistics, KeepsTheLongestTimeWithoutANewerAnswer) {
  ForceAgeStatistics age;
  for (std::uint32_t seq = 1; seq <= 5; ++seq) age.inputSent(seq, seq * kMillisecondOfAge, kMillisecondOfAge);
  for (const std::uint32_t seq : {1, 2, 4, 3, 5})
    age.answerReceived(answer(HandId{0}, seq, seq), std::max(seq, 2U) * kMillisecondOfAge);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_DOUBLE_EQ(telemetry.longest_silence, 2e-3);
}

TEST(ForceAgeStatistics, AServerThatBeganAnewNumbersInputsAnew) {
  ForceAgeStatistics age;
  age.inputSent(500, 500 * kMillisecondOfAge, kMillisecondOfAge);
  age.answerReceived(answer(HandId{0}, 500, 500), 502 * kMillisecondOfAge);
  age.inputSent(1, 900 * kMillisecondOfAge, kMillisecondOfAge);
  age.answerReceived(answer(HandId{0}, 1, 1, 2), 903 * kMillisecondOfAge);
  Telemetry telemetry;
  age.fill(telemetry);
  EXPECT_EQ(telemetry.samples, 2U);
  EXPECT_EQ(telemetry.longest_silence, 0.0);
}

}  // namespace
}  // namespace tenon::haptic
