#include "clients/haptic/answer_loss.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr std::int64_t kAnswerPeriod = 1'000'000;  // [ns]

TEST(AnswerLoss, IsThatOfTheHandThatLostMost) {
  AnswerLoss loss;
  EXPECT_FALSE(loss.take());
  for (std::uint32_t sent = 1; sent <= 1001; ++sent) {
    if (sent % 10 != 5) loss.received(HandId{0}, sent, sent * kAnswerPeriod);
    if (sent % 10 == 0) loss.received(HandId{0}, sent, sent * kAnswerPeriod);  // again
    loss.received(HandId{7}, sent, sent * kAnswerPeriod);
  }
  EXPECT_NEAR(loss.take().value_or(-1.0), 0.1, 1e-9);
  EXPECT_FALSE(loss.take()) << "none since then";
}

// jitter: ten come at once, and in any order
TEST(AnswerLoss, WhatComesLateOrAfterANewerOneIsNotLost) {
  AnswerLoss loss;
  for (std::uint32_t sent = 0; sent < 1000; sent += 10)
    for (std::uint32_t i = 0; i < 10; ++i)
      loss.received(HandId{0}, sent + (7 * i) % 10, (sent + 10) * kAnswerPeriod);
  EXPECT_EQ(loss.take(), 0.0);
}

TEST(AnswerLoss, OneThatComesInTheNextSecondIsLostInNone) {
  AnswerLoss loss;
  for (const std::uint32_t sent : {1U, 2U, 4U}) loss.received(HandId{0}, sent, 0);
  EXPECT_TRUE(loss.take());
  for (const std::uint32_t sent : {3U, 5U, 6U}) loss.received(HandId{0}, sent, 0);
  EXPECT_EQ(loss.take(), 0.0);
}

TEST(AnswerLoss, WhatDoesNotComeInAnInterruptionOrFromAFormerServerIsNoLossOfTheLink) {
  AnswerLoss loss;
  for (std::uint32_t sent = 2001; sent <= 2100; ++sent) loss.received(HandId{0}, sent, sent * kAnswerPeriod);
  for (std::uint32_t sent = 5101; sent <= 5200; ++sent) loss.received(HandId{0}, sent, sent * kAnswerPeriod);
  EXPECT_EQ(loss.take(), 0.0) << "a partition of 3 s";
  for (std::uint32_t sent = 1; sent <= 100; ++sent)
    loss.received(HandId{0}, sent, (5200 + sent) * kAnswerPeriod);
  EXPECT_EQ(loss.take(), 0.0) << "another server";
}

}  // namespace
}  // namespace tenon::haptic
