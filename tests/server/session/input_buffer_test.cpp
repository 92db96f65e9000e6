#include "server/session/input_buffer.h"

#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/session/gap_meter.h"
#include "tests/support/realtime_guard.h"

namespace tenon::session {
namespace {

constexpr HandId kOnlyHand{0};

/// What the wire thread does with messages of which a link loses some: the newest sample, and those of lost
/// messages that the next one carries.
class LossyMessages {
 public:
  explicit LossyMessages(InputBuffer& buffer) : buffer_(buffer) {}
  void receive(std::uint32_t seq, std::uint32_t earlier) {
    for (std::uint32_t i = std::min(earlier, seq - 1); i > 0; --i)
      if (seq - i > newest_) buffer_.put({.hand = kOnlyHand, .seq = seq - i});
    newest_ = seq;
    buffer_.put({.hand = kOnlyHand, .seq = seq});
  }

 private:
  InputBuffer& buffer_;
  std::uint32_t newest_ = 0;
};

/// The samples that ticks take of `inputs` of which `loss` [-] are lost at random.
std::vector<std::uint32_t> taken(InputBuffer& buffer, std::uint32_t inputs, double loss,
                                 std::uint32_t earlier) {
  LossyMessages messages(buffer);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> chance(0.0, 1.0);
  std::vector<std::uint32_t> seqs;
  TickInput input;
  for (std::uint32_t tick = 1; tick <= inputs; ++tick) {
    if (chance(random) >= loss) messages.receive(tick, earlier);
    buffer.collect(tick, input);
    for (const HandReading& reading : input.readings) seqs.push_back(reading.seq);
  }
  return seqs;
}

TEST(InputBuffer, OfALinkThatLosesTwoPercentNearlyNoTickLacksAnInput) {
  constexpr std::uint32_t kInputs = 100'000;
  InputBuffer newest(1), played(1);
  played.setPlayout(kOnlyHand, 2);
  taken(newest, kInputs, 0.02, 0);
  EXPECT_NEAR(newest.missed(kOnlyHand), 0.02 * kInputs, 0.002 * kInputs);
  const auto seqs = taken(played, kInputs, 0.02, 2);
  EXPECT_LE(played.missed(kOnlyHand), 0.0001 * kInputs);
  EXPECT_EQ(played.replaced(kOnlyHand), 0U);
  for (std::size_t i = 1; i < seqs.size(); ++i) ASSERT_GT(seqs[i], seqs[i - 1]);
}

TEST(InputBuffer, WithoutAPlayoutATickTakesTheNewest) {
  InputBuffer buffer(1);
  TickInput input;
  for (std::uint32_t seq = 1; seq <= 3; ++seq) buffer.put({.hand = kOnlyHand, .seq = seq});
  buffer.collect(1, input);
  ASSERT_EQ(input.readings.size(), 1U);
  EXPECT_EQ(input.readings[0].seq, 3U);
  EXPECT_EQ(buffer.replaced(kOnlyHand), 2U);
  buffer.collect(2, input);
  EXPECT_TRUE(input.readings.empty());
  EXPECT_EQ(buffer.missed(kOnlyHand), 1U);
}

TEST(InputBuffer, AfterASilenceItIsNoFurtherBehindThanThePlayout) {
  InputBuffer buffer(1);
  buffer.setPlayout(kOnlyHand, 1);
  TickInput input;
  for (std::uint32_t seq = 1; seq <= 40; ++seq) buffer.put({.hand = kOnlyHand, .seq = seq});
  buffer.collect(1, input);
  EXPECT_EQ(input.readings[0].seq, 39U);
  buffer.collect(2, input);
  EXPECT_EQ(input.readings[0].seq, 40U);
  buffer.collect(3, input);
  EXPECT_TRUE(input.readings.empty()) << "nothing is taken twice";
}

TEST(InputBuffer, ChangesOfThePlayoutTakeNothingTwice) {
  InputBuffer buffer(1);
  TickInput input;
  std::uint32_t last = 0;
  for (std::uint32_t tick = 1; tick <= 300; ++tick) {
    if (tick % 50 == 0) buffer.setPlayout(kOnlyHand, tick / 50 % 3);
    buffer.put({.hand = kOnlyHand, .seq = tick});
    if (tick % 7 != 0) buffer.collect(tick, input);
    for (const HandReading& reading : input.readings) {
      ASSERT_GT(reading.seq, last);
      last = reading.seq;
    }
    input.readings.clear();
  }
  EXPECT_GE(last, 298U);
}

TEST(InputBuffer, AReadingOfTheFormerStationIsNotTheFirstOfTheNextOne) {
  for (const std::uint32_t playout : {0U, 2U}) {
    InputBuffer buffer(1);
    buffer.setPlayout(kOnlyHand, playout);
    TickInput input;
    for (std::uint32_t seq = 70; seq < 75; ++seq) buffer.put({.hand = kOnlyHand, .seq = seq});
    buffer.restart(kOnlyHand);
    buffer.setPlayout(kOnlyHand, playout);
    buffer.collect(1, input);
    EXPECT_TRUE(input.readings.empty()) << "it came before the seat was taken over";
    buffer.put({.hand = kOnlyHand, .seq = 1});
    buffer.collect(2, input);
    ASSERT_EQ(input.readings.size(), 1U);
    EXPECT_EQ(input.readings[0].seq, 1U);
  }
}

TEST(InputBuffer, CollectsWithoutAllocatingOrLocking) {
  InputBuffer buffer(1);
  buffer.setPlayout(kOnlyHand, 2);
  TickInput input;
  const test::RealtimeGuard guard;
  for (std::uint32_t tick = 1; tick <= 1000; ++tick) {
    buffer.put({.hand = kOnlyHand, .seq = tick});
    if (tick % 3 != 0) buffer.collect(tick, input);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

TEST(GapMeter, KnowsTheLongestSilenceOfTheLastSeconds) {
  constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]
  GapMeter meter;
  EXPECT_EQ(meter.longest(5), 0.0);
  std::int64_t now = kMillisecond;
  const auto send = [&](int count) {
    for (int i = 0; i < count; ++i) meter.received(now += kMillisecond);
  };
  send(100);
  EXPECT_DOUBLE_EQ(meter.longest(now), 0.001);
  now += 29 * kMillisecond;
  send(500);
  EXPECT_DOUBLE_EQ(meter.longest(now), 0.030);
  EXPECT_DOUBLE_EQ(meter.longest(now + 80 * kMillisecond), 0.080) << "one that lasts";
  send(2000);
  EXPECT_DOUBLE_EQ(meter.longest(now), 0.001) << "forgotten";
}

}  // namespace
}  // namespace tenon::session
