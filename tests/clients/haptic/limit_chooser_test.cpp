#include "clients/haptic/limit_chooser.h"

#include <limits>

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr LinkMeasurement kQuiet{.input_gap = 0.003, .trip_jitter = 1e-4, .age_jitter = 0.001};

TEST(LimitChooser, AQuietLinkKeepsTheShortestLimits) {
  LimitChooser chooser;
  const LinkChoice choice = chooser.step(kQuiet);
  EXPECT_EQ(choice.limits, HandLimits{});
  EXPECT_EQ(choice.playout_ticks, 0U);
  EXPECT_DOUBLE_EQ(choice.jitter, 0.001);
}

TEST(LimitChooser, ALinkThatBecomesWorseRaisesThemAtOnceAndOneThatRecoversLowersThemLater) {
  LimitChooser chooser;
  EXPECT_EQ(chooser.step(kQuiet).limits.freeze_ticks, kFreezeTicks);
  LinkMeasurement bad = kQuiet;
  bad.input_gap = 0.040;
  const LinkChoice worse = chooser.step(bad);
  EXPECT_EQ(worse.limits.freeze_ticks, 100U) << "twice the gap and 20 ms";
  EXPECT_EQ(worse.limits.park_ticks, 1500U);
  for (std::size_t i = 1; i < LimitChooser::kMemory; ++i)
    EXPECT_EQ(chooser.step(kQuiet).limits, worse.limits) << "second " << i;
  EXPECT_EQ(chooser.step(kQuiet).limits, HandLimits{});
}

TEST(LimitChooser, TheLossIsThatOfTheWorseDirectionAndThatOfAnswersIsForgottenSlowly) {
  LimitChooser chooser;
  LinkMeasurement now = kQuiet;
  now.inputs_lost = 0.01;
  EXPECT_DOUBLE_EQ(chooser.step(now).loss, 0.01) << "that of answers is not known";
  // single seconds say little of a rate of 50 a second
  for (int i = 0; i < 50; ++i) {
    now.answers_lost = i % 2 == 0 ? 0.1 : 0.0;
    EXPECT_LT(chooser.step(now).loss, 0.07);
  }
  EXPECT_NEAR(chooser.step(now).loss, 0.05, 0.01);
  EXPECT_EQ(chooser.step(now).playout_ticks, 1U) << "inputs alone are kept back";
  now.answers_lost.reset();
  EXPECT_GT(chooser.step(now).loss, 0.03);
  for (int i = 0; i < 300; ++i) static_cast<void>(chooser.step(now));
  EXPECT_NEAR(chooser.step(now).loss, 0.01, 1e-12);
}

TEST(LimitChooser, ASteadyLossOfAnswersAboveTheMostCountsAsTheMostAndAnInterruptionDoesNot) {
  LimitChooser chooser;
  LinkMeasurement now = kQuiet;
  now.answers_lost = 0.0;
  static_cast<void>(chooser.step(now));
  now.answers_lost = 0.6;
  for (int i = 0; i < 2; ++i) EXPECT_EQ(chooser.step(now).loss, 0.0) << "an interruption";
  EXPECT_GT(chooser.step(now).loss, 0.0);
  for (int i = 0; i < 50; ++i) EXPECT_LE(chooser.step(now).loss, 0.2);
  EXPECT_GT(chooser.step(now).loss, 0.19);
}

TEST(LimitChooser, NoLinkHoweverBadLeavesAHandUnfrozenForLongerThanTheBound) {
  LimitChooser chooser;
  const double kInfinite = std::numeric_limits<double>::infinity();
  const LinkChoice choice = chooser.step({kInfinite, kInfinite, kInfinite, 1.0});
  EXPECT_EQ(choice.limits.freeze_ticks, kMostFreezeTicks);
  EXPECT_LE(choice.limits.park_ticks, kMostParkTicks);
  LimitChooser of_nothing;
  const double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(of_nothing.step({kNaN, kNaN, kNaN, kNaN}).limits, HandLimits{});
}

TEST(LimitChooser, WhatWasMeasuredOverAKilledServerIsNotTheLinks) {
  LimitChooser chooser;
  const LinkMeasurement usual{.input_gap = 0.004, .age_jitter = 0.002, .inputs_lost = 1e-3};
  for (int i = 0; i < 5; ++i) static_cast<void>(chooser.step(usual));
  const LinkChoice before = chooser.step(usual);
  chooser.interrupted();
  const LinkMeasurement killed{.input_gap = 0.25, .trip_jitter = 0.3, .age_jitter = 1.5, .inputs_lost = 0.9};
  EXPECT_EQ(chooser.step(killed), before);
  EXPECT_EQ(chooser.step(killed), before);
  EXPECT_EQ(chooser.step(usual), before);
  EXPECT_GT(chooser.step(killed).limits.freeze_ticks, before.limits.freeze_ticks) << "and now it is";
}

TEST(LimitChooser, AnInterruptionEarnsNoPatienceAndKeepsWhatIsKeptBack) {
  LimitChooser chooser;
  LinkMeasurement lossy = kQuiet;
  lossy.inputs_lost = 0.02;
  const LinkChoice before = chooser.step(lossy);
  EXPECT_EQ(before.playout_ticks, 2U);
  LinkMeasurement interrupted = lossy;
  interrupted.input_gap = 0.45;
  interrupted.inputs_lost = 0.205;
  const LinkChoice after = chooser.step(interrupted);
  EXPECT_EQ(after.playout_ticks, 2U);
  EXPECT_EQ(after.limits, before.limits);
}

TEST(LimitChooser, LossAndJitterAloneLetExpectGaps) {
  LimitChooser chooser;
  LinkMeasurement lossy = kQuiet;
  lossy.inputs_lost = 0.5;  // of a million inputs one begins a gap of 20
  lossy.trip_jitter = 0.020;
  EXPECT_EQ(chooser.step(lossy).limits.freeze_ticks, 100U);
}

TEST(LimitChooser, KeepsInputsBackWhereTheNextOneBringsWhatWasLost) {
  const auto playout = [](double lost, double jitter) {
    LimitChooser chooser;
    LinkMeasurement link = kQuiet;
    link.inputs_lost = lost;
    link.trip_jitter = jitter;
    return chooser.step(link).playout_ticks;
  };
  EXPECT_EQ(playout(0.0, 1e-4), 0U);
  EXPECT_EQ(playout(5e-5, 1e-4), 0U) << "one in 20,000 is allowed";
  EXPECT_EQ(playout(0.005, 1e-4), 1U) << "two in a row: one in 40,000";
  EXPECT_EQ(playout(0.02, 1e-4), 2U) << "two in a row: one in 2,500";
  EXPECT_EQ(playout(0.02, 0.005), 0U) << "jitter of several ticks";
}

}  // namespace
}  // namespace tenon::haptic
