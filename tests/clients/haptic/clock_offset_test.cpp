#include "clients/haptic/clock_offset.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;  // [ns]

/// An exchange that begins at `at_ns` by the station's clock, which the server's is ahead of by `offset_ns`.
struct Link {
  std::int64_t offset_ns, forth_ns, back_ns;

  void exchange(ClockOffset& clock, std::int64_t at_ns) const {
    const std::int64_t received = at_ns + forth_ns + offset_ns;
    const std::int64_t sent = received + kMillisecond / 10;
    clock.add({ClientId{1}, at_ns, received, sent}, sent - offset_ns + back_ns);
  }
};

TEST(ClockOffset, IsUnknownBeforeAnAnswer) {
  const ClockOffset clock;
  EXPECT_FALSE(clock.known());
  EXPECT_TRUE(std::isinf(clock.error(0)));
}

TEST(ClockOffset, ALinkThatBecomesLongerIsKnownWithinSeconds) {
  ClockOffset clock;
  std::int64_t now = 7'000 * kMillisecond;
  const auto exchange = [&](std::int64_t way) {
    Link{0, way, way}.exchange(clock, now += 200 * kMillisecond);
  };
  for (int i = 0; i < 100; ++i) exchange(5 * kMillisecond);
  for (std::uint64_t i = 0; i < ClockOffset::kTrips; ++i) {
    EXPECT_NEAR(clock.roundTrip(), 0.01, 1e-9) << "it may be jitter";
    exchange(30 * kMillisecond);
  }
  EXPECT_NEAR(clock.roundTrip(), 0.06, 1e-9);
  EXPECT_NEAR(clock.offset(), 0.0, 1e-9);
}

TEST(ClockOffset, IsExactOnALinkThatIsAlikeBothWays) {
  ClockOffset clock;
  Link{-5'000 * kMillisecond, 50 * kMillisecond, 50 * kMillisecond}.exchange(clock, 7'000 * kMillisecond);
  EXPECT_NEAR(clock.offset(), -5.0, 1e-9);
  EXPECT_NEAR(clock.roundTrip(), 0.1, 1e-9);
}

TEST(ClockOffset, IsWithinItsErrorHoweverDifferentTheDirectionsAre) {
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::int64_t> delay(0, 80 * kMillisecond);
  for (int run = 0; run < 100; ++run) {
    ClockOffset clock;
    std::int64_t now = 0;
    for (int i = 0; i < 20; ++i, now += 200 * kMillisecond)
      Link{1'234 * kMillisecond, delay(random), delay(random) / 4}.exchange(clock, now);
    EXPECT_LE(std::abs(clock.offset() - 1.234), clock.error(now));
    EXPECT_LT(clock.error(now), 0.03) << "the shortest of twenty round trips";
  }
}

TEST(ClockOffset, GrowsOldAndForgets) {
  ClockOffset clock;
  Link{0, kMillisecond, kMillisecond}.exchange(clock, 0);
  EXPECT_NEAR(clock.error(2 * kMillisecond), 1e-3, 1e-6);
  EXPECT_NEAR(clock.error(10'000 * kMillisecond), 2e-3, 1e-5) << "100 us a second";
  for (int i = 1; i <= 64; ++i)
    Link{kMillisecond, 3 * kMillisecond, 3 * kMillisecond}.exchange(clock, i * 200 * kMillisecond);
  EXPECT_NEAR(clock.offset(), 1e-3, 1e-9);
}

TEST(ClockOffset, IgnoresStampsThatContradictEachOther) {
  ClockOffset clock;
  clock.add({ClientId{1}, 100, 200, 150}, 300);
  clock.add({ClientId{1}, 400, 200, 250}, 300);
  EXPECT_FALSE(clock.known());
}

}  // namespace
}  // namespace tenon::haptic
