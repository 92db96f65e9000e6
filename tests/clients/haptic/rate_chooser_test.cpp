#include "clients/haptic/rate_chooser.h"

#include <cstdint>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/input_pacer.h"

namespace tenon::haptic {
namespace {

constexpr auto kCopy = ForceModelKind::kSceneCopy;
constexpr auto kListed = ForceModelKind::kManifold;

TEST(RateChooser, ALongLinkHasSparseInputsAndSlowAnswersACopySlowAnswersAlone) {
  struct Second {
    std::optional<double> round_trip;
    ForceModelKind kind;
    bool far, slow;
  };
  RateChooser rates;
  for (const Second& second : {Second{std::nullopt, kListed, false, false},
                               {0.001, kListed, false, false},
                               {0.010, kCopy, false, true},
                               {0.021, kCopy, true, true},
                               {0.016, kCopy, true, true},
                               {std::nullopt, kListed, true, true},
                               {0.014, kListed, false, false}}) {
    rates.step(second.round_trip, second.kind, 0.0, 0.0);
    EXPECT_EQ(rates.isFar(), second.far) << second.round_trip.value_or(0.0);
    EXPECT_EQ(rates.slowAnswers(), second.slow) << second.round_trip.value_or(0.0);
  }
}

TEST(RateChooser, AnswersAreSlowOnlyWhereThoseLostInARowAndJitterAreNoGap) {
  struct Link {
    double round_trip, loss;
    bool slow;
    double jitter = 0.0;  // [s]
  };
  for (const Link& link : {Link{0.010, 0.001, true},
                           {0.010, 0.02, true},
                           {0.010, 0.1, false},
                           {0.050, 0.02, true},
                           {0.050, 0.1, false},
                           {0.100, 0.1, true},
                           {0.100, 0.2, true},
                           {0.010, 0.001, true, 0.005},
                           {0.010, 0.02, true, 0.005},
                           {0.010, 0.02, false, 0.015},
                           {0.100, 0.1, false, 0.05}}) {
    RateChooser rates;
    rates.step(link.round_trip, kCopy, link.loss, link.jitter);
    EXPECT_EQ(rates.slowAnswers(), link.slow) << link.round_trip << " s, " << link.loss;
    EXPECT_EQ(rates.allowance() >= RateChooser::kSlowAnswers, link.slow);
  }
}

TEST(RateChooser, ATenthIsTakenToBeLostUntilTheLossIsKnown) {
  RateChooser rates;
  rates.step(std::nullopt, kCopy, std::nullopt, 0.0);
  EXPECT_FALSE(rates.isFar()) << "nothing is known yet";
  rates.step(0.05, kCopy, std::nullopt, 0.0);
  EXPECT_TRUE(rates.isFar());
  EXPECT_FALSE(rates.slowAnswers());
  rates.step(0.1, kCopy, std::nullopt, 0.0);
  EXPECT_TRUE(rates.slowAnswers());
}

TEST(RateChooser, PeriodsAreBounded) {
  RateChooser rates;
  EXPECT_EQ(rates.inputPeriod(1), 1);
  EXPECT_EQ(rates.inputPeriod(4), 4);
  rates.step(0.1, kListed, 0.0, 0.0);
  EXPECT_EQ(rates.inputPeriod(1), 5);
  EXPECT_EQ(rates.inputPeriod(4), kMostInputPeriod);
  EXPECT_EQ(rates.inputPeriod(20), kMostInputPeriod);
}

/// Cycles of a thousand in which the input of a hand, index 0, and that of a limb, index 1, are sent.
std::vector<std::uint32_t> sentOfAThousand(const RateChooser& rates) {
  InputPacer pacer;
  DeviceInput hand, limb;
  limb.period = 4;
  hand.earlier.resize(kEarlierSamples);
  std::vector<std::uint32_t> sent(2, 0);
  for (std::uint32_t seq = 1; seq <= 1000; ++seq) {
    if (seq % 97 == 0) continue;  // the wire thread has not seen this cycle's
    const auto of_hand = pacer.due(hand, 0, seq, rates, 1);
    const auto of_limb = pacer.due(limb, 1, seq, rates, 1);
    sent[0] += of_hand.has_value();
    sent[1] += of_limb.has_value();
    if (of_hand) {
      EXPECT_EQ(of_hand->earlier.size(), of_hand->period > 1 ? 0U : 1U);
    }
    if (of_limb) {
      EXPECT_EQ(of_limb->period, rates.inputPeriod(4));
    }
  }
  return sent;
}

TEST(InputPacer, SendsWhatIsDueEvenIfCyclesAreMissed) {
  RateChooser rates;
  auto sent = sentOfAThousand(rates);
  EXPECT_EQ(sent[0], 990U);
  EXPECT_NEAR(sent[1], 250U, 8);
  rates.step(0.1, kListed, 0.0, 0.0);
  sent = sentOfAThousand(rates);
  EXPECT_NEAR(sent[0], 200U, 4);
  EXPECT_NEAR(sent[1], 50U, 2);
}

}  // namespace
}  // namespace tenon::haptic
