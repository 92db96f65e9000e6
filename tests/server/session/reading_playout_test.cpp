#include "server/session/reading_playout.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/resolution.h"
#include "server/session/input_buffer.h"
#include "tests/support/realtime_guard.h"

namespace tenon::session {
namespace {

constexpr HandId kMoved{0};

/// A hand that swings by 0.1 m at 1 Hz, at most 0.63 m/s, and turns by 0.5 rad.
HandReading swinging(std::uint32_t seq) {
  const double t = seq * kTickSeconds, w = 2.0 * M_PI;
  return {
      .hand = kMoved,
      .seq = seq,
      .X_WH = {Vector3(0.1 * std::sin(w * t), 0.2, 0.3), expRotation(Vector3(0, 0, 0.5 * std::sin(w * t)))},
      .V_WH = {Vector3(0.1 * w * std::cos(w * t), 0, 0), Vector3(0, 0, 0.5 * w * std::cos(w * t))}};
}

struct SparseLink {
  std::uint32_t period = 5;
  std::uint32_t jitter = 0;  // [ticks]
  double loss = 0.0;         // [-]
};

/// What each of `ticks` takes of swinging() over a link without other delay.
std::vector<HandReading> takenOver(const SparseLink& link, std::uint32_t ticks, InputBuffer& buffer) {
  std::mt19937 random(5);
  std::vector<std::vector<std::uint32_t>> arrivals(ticks + link.jitter + 1);
  for (std::uint32_t seq = 1; seq <= ticks; seq += link.period) {
    if (std::uniform_real_distribution(0.0, 1.0)(random) < link.loss) continue;
    arrivals[seq + (link.jitter > 0 ? random() % (link.jitter + 1) : 0)].push_back(seq);
  }
  buffer.setPeriod(kMoved, link.period);
  std::vector<HandReading> all;
  TickInput input;
  std::uint32_t newest = 0;
  for (std::uint32_t tick = 1; tick <= ticks; ++tick) {
    for (const std::uint32_t seq : arrivals[tick])
      if (seq > newest) buffer.put(swinging(newest = seq));
    buffer.collect(tick, input);
    for (const HandReading& reading : input.readings) all.push_back(reading);
  }
  return all;
}

struct SparseCase {
  SparseLink link;
  std::uint32_t most_behind;  // [ticks]
  double most_missed;         // [-]
};

class SparseInputs : public testing::TestWithParam<SparseCase> {};

TEST_P(SparseInputs, EachTickHasAReadingOnTheHandsPath) {
  constexpr std::uint32_t kTicks = 20'000;
  InputBuffer buffer(1);
  const auto all = takenOver(GetParam().link, kTicks, buffer);
  EXPECT_LE(buffer.missed(kMoved), GetParam().most_missed * kTicks);
  EXPECT_LE(kTicks - all.back().seq, GetParam().most_behind);
  for (std::size_t i = 1; i < all.size(); ++i) {
    ASSERT_GT(all[i].seq, all[i - 1].seq);
    ASSERT_LE(all[i].seq - all[i - 1].seq, 2U) << "no jump of the hand";
    const HandReading truth = swinging(all[i].seq);
    // chord of 3 periods, of which one sample may be lost: a T^2 / 8, a = 4 m/s^2
    const double T = 3.0 * GetParam().link.period * kTickSeconds;
    const double chord = 4.0 * T * T / 8.0 + kPositionStep;
    ASSERT_LT((all[i].X_WH.translation() - truth.X_WH.translation()).norm(), chord);
    ASSERT_LT(displacement(truth.X_WH, all[i].X_WH).rotation.norm(), 5.0 * chord + kRotationStep * 4);
    ASSERT_LT((all[i].V_WH.linear - truth.V_WH.linear).norm(), 4.0 * T);
  }
}

INSTANTIATE_TEST_SUITE_P(Links, SparseInputs,
                         testing::Values(SparseCase{{5, 0, 0.0}, 10, 0.001},
                                         SparseCase{{20, 0, 0.0}, 40, 0.002},
                                         SparseCase{{5, 5, 0.0}, 20, 0.002},
                                         SparseCase{{5, 5, 0.02}, 25, 0.01}),
                         [](const auto& one) {
                           const SparseLink& link = one.param.link;
                           return "Each" + std::to_string(link.period) + "Jitter" +
                                  std::to_string(link.jitter) + "Loss" +
                                  std::to_string(static_cast<int>(100 * link.loss));
                         });

TEST(SparseInputsOfAHand, AreFollowedByEachTicksOwnWithoutAJump) {
  InputBuffer buffer(1);
  TickInput input;
  std::uint32_t last = 0, tick = 1;
  const auto run = [&](std::uint32_t period, std::uint32_t until) {
    buffer.setPeriod(kMoved, period);
    for (; tick <= until; ++tick) {
      if (tick % period == 0) buffer.put(swinging(tick));
      buffer.collect(tick, input);
      for (const HandReading& reading : input.readings) {
        EXPECT_GT(reading.seq, last);
        if (last > 0) {
          EXPECT_LE(reading.seq - last, 2U);
        }
        last = reading.seq;
      }
    }
  };
  run(1, 100);
  EXPECT_EQ(last, 100U);
  run(5, 200);
  EXPECT_GE(last, 190U);
  run(1, 300);
  EXPECT_EQ(last, 300U) << "the delay is worked off";
}

//   a link with jitter that becomes near: 10 ticks behind and more, of which a tick takes two, on the path
TEST(SparseInputsOfAHand, FarBehindAreCaughtUpWithByOneMoreTickATick) {
  constexpr std::uint32_t kPeriod = 5;
  constexpr double kT = kPeriod * kTickSeconds;
  for (const std::uint32_t behind : {10U, 20U, 40U, kMostFreezeTicks - kPeriod}) {
    ReadingPlayout playout;
    playout.add(swinging(100));
    ASSERT_NE(playout.takeBetween(kPeriod), nullptr);
    std::uint32_t heard = 100, last = 100;
    while (heard < 100 + behind) playout.add(swinging(heard += kPeriod));
    for (int tick = 0; tick < 500; ++tick) {
      playout.add(swinging(++heard));
      const HandReading* const reading = playout.takeBetween(1);
      ASSERT_NE(reading, nullptr);
      ASSERT_GE(reading->seq - last, 1U) << behind;
      ASSERT_LE(reading->seq - last, 2U) << behind;
      const Vector3 off = reading->X_WH.translation() - swinging(reading->seq).X_WH.translation();
      ASSERT_LT(off.norm(), 4.0 * kT * kT / 8.0 + kPositionStep) << behind << ", chord of one period";
      last = reading->seq;
    }
    EXPECT_LE(heard - last, 1U) << behind;
  }
}

//   of the inputs' delay this is the server's part, which counts in the round trip of a shared part
TEST(SparseInputsOfAHand, AreKeptBackByAsMuchAsTheServerTells) {
  constexpr std::uint32_t kTicks = 20'000;
  for (const SparseLink& link : {SparseLink{5, 0, 0.0}, SparseLink{5, 0, 0.02}, SparseLink{5, 4, 0.02}}) {
    InputBuffer buffer(1);
    const auto all = takenOver(link, kTicks, buffer);
    std::uint32_t behind = 0;  // of the last second, of a sample that took no time
    for (std::size_t i = all.size() - 1000; i < all.size(); ++i)
      behind = std::max(behind, static_cast<std::uint32_t>(kTicks - (all.size() - 1 - i) - all[i].seq));
    EXPECT_GE(behind, link.period - 1);
    EXPECT_NEAR(buffer.keptBack(kMoved), behind, 2.0) << "jitter " << link.jitter << ", loss " << link.loss;
    buffer.setPeriod(kMoved, 1);
    EXPECT_EQ(buffer.keptBack(kMoved), 0U) << "what is left is worked off";
    buffer.setPlayout(kMoved, 2);
    EXPECT_EQ(buffer.keptBack(kMoved), 2U);
  }
}

TEST(SparseInputsOfAHand, AfterASilenceAreOnePeriodBehind) {
  ReadingPlayout playout;
  for (const std::uint32_t seq : {5U, 10U}) playout.add(swinging(seq));
  ASSERT_NE(playout.takeBetween(5), nullptr);
  playout.add(swinging(400));
  const HandReading* const reading = playout.takeBetween(5);
  ASSERT_NE(reading, nullptr);
  EXPECT_EQ(reading->seq, 395U);
}

//   a silence of 60 ticks: only where the hand was frozen meanwhile, what was missed is skipped
TEST(SparseInputsOfAHand, AreCaughtUpWithAfterASilenceUnlessTheHandWasFrozen) {
  constexpr std::uint32_t kPeriod = 5, kSilence = 60, kLast = 100;
  for (const std::uint32_t freeze : {kFreezeTicks, kMostFreezeTicks}) {
    InputBuffer buffer(1);
    buffer.setPeriod(kMoved, kPeriod);
    buffer.setFreeze(kMoved, freeze);
    TickInput input;
    std::uint32_t last = 0, largest_step = 0;
    for (std::uint32_t tick = kPeriod; tick <= kLast + 2 * kSilence; ++tick) {
      const bool is_silent = tick > kLast && tick <= kLast + kSilence;
      if (tick % kPeriod == 0 && !is_silent) buffer.put(swinging(tick));
      buffer.collect(tick, input);
      for (const HandReading& reading : input.readings) {
        if (last > 0) largest_step = std::max(largest_step, reading.seq - last);
        last = reading.seq;
      }
      if (tick != kLast + kSilence + kPeriod) continue;
      if (freeze == kFreezeTicks) {
        EXPECT_EQ(last, tick - kPeriod);
        const Vector3 off = input.readings.back().X_WH.translation() - swinging(tick).X_WH.translation();
        EXPECT_LT(off.norm(), 1e-3 * kPeriod) << "the hand moves by less than 1 m/s";
      }
    }
    if (freeze == kMostFreezeTicks) {
      EXPECT_LE(largest_step, 2U);
    }
  }
}

TEST(SparseInputsOfAHand, OfAnotherStationBeginAnew) {
  InputBuffer buffer(1);
  TickInput input;
  buffer.setPeriod(kMoved, 5);
  for (std::uint32_t seq = 1000; seq <= 1020; seq += 5) buffer.put(swinging(seq));
  buffer.collect(1, input);
  buffer.restart(kMoved);
  buffer.collect(2, input);
  EXPECT_TRUE(input.readings.empty());
  buffer.put(swinging(1));
  buffer.collect(3, input);
  ASSERT_EQ(input.readings.size(), 1U);
  EXPECT_EQ(input.readings[0].seq, 1U);
}

TEST(Between, IsActiveIfBothAreAndTurnsTheShortWay) {
  HandReading from = swinging(10), to = swinging(20);
  to.X_WH.rotation().coeffs() = -to.X_WH.rotation().coeffs();
  const HandReading middle = between(from, to, 15);
  EXPECT_TRUE(middle.active);
  EXPECT_LT(displacement(swinging(15).X_WH, middle.X_WH).rotation.norm(), 1e-3);
  EXPECT_EQ(middle.X_WH, rounded(middle.X_WH)) << "as over the wire";
  to.active = false;
  EXPECT_FALSE(between(from, to, 15).active);
}

TEST(Between, AllocatesAndLocksNothing) {
  InputBuffer buffer(1);
  buffer.setPeriod(kMoved, 5);
  TickInput input;
  const test::RealtimeGuard guard;
  for (std::uint32_t tick = 1; tick <= 1000; ++tick) {
    if (tick % 5 == 0) buffer.put(swinging(tick));
    buffer.collect(tick, input);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::session
