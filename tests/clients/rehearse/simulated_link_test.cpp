#include "clients/rehearse/simulated_link.h"

#include <vector>

#include <gtest/gtest.h>

namespace tenon::rehearse {
namespace {

constexpr Tick kSent = 20'000;

/// Arrivals of one message a tick; 0: it is lost.
std::vector<Tick> arrivals(const LinkConditions& options, std::uint64_t seed = 1) {
  LinkDirection direction(options, seed);
  std::vector<Tick> all;
  for (Tick tick = 1; tick <= kSent; ++tick) all.push_back(direction.arrival(tick).value_or(0));
  return all;
}

double shareLost(const std::vector<Tick>& arrivals) {
  return static_cast<double>(std::count(arrivals.begin(), arrivals.end(), Tick{0})) / kSent;
}

TEST(SimulatedLink, DelaysEachMessageAlikeWithoutJitter) {
  const std::vector<Tick> all = arrivals({.delay = 25});
  for (Tick tick = 1; tick <= kSent; ++tick) ASSERT_EQ(all[tick - 1], tick + 25);
}

TEST(SimulatedLink, WithJitterMessagesOvertakeOthers) {
  const std::vector<Tick> all = arrivals({.delay = 50, .jitter = 5});
  bool overtaken = false;
  for (Tick tick = 1; tick <= kSent; ++tick) {
    ASSERT_GE(all[tick - 1], tick + 50);
    ASSERT_LE(all[tick - 1], tick + 55);
    overtaken = overtaken || (tick > 1 && all[tick - 1] < all[tick - 2]);
  }
  EXPECT_TRUE(overtaken);
}

TEST(SimulatedLink, LosesItsShareAndTheSameMessagesForTheSameSeed) {
  const LinkConditions options{.loss = 0.1};
  EXPECT_NEAR(shareLost(arrivals(options)), 0.1, 0.01);
  EXPECT_EQ(arrivals(options), arrivals(options));
  EXPECT_NE(arrivals(options, 1), arrivals(options, 2));
}

TEST(SimulatedLink, LosesInGapsOfTheGivenLength) {
  const std::vector<Tick> all = arrivals({.loss = 0.05, .burst = 20});
  EXPECT_NEAR(shareLost(all), 0.05, 0.02);
  int gaps = 0, lost = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    lost += all[i] == 0 ? 1 : 0;
    gaps += all[i] == 0 && all[i - 1] != 0 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(lost) / gaps, 20.0, 6.0);
}

TEST(SimulatedLink, GivesTheServerEachInputOnceAndNoneThatWasOvertaken) {
  SimulatedLink link({.delay = 3, .jitter = 4, .seed = 7});
  std::uint32_t newest = 0;
  for (Tick tick = 1; tick <= 200; ++tick) {
    DeviceInput input;
    input.hand = HandId{0};
    input.sample.seq = static_cast<std::uint32_t>(tick);
    link.send(input, tick);
    link.receive(tick, [&](const DeviceInput& one, std::uint32_t before) {
      EXPECT_TRUE(newest == 0 || before == newest);
      EXPECT_GT(one.sample.seq, newest);
      newest = one.sample.seq;
    });
  }
  EXPECT_GE(newest, 193U);
}

}  // namespace
}  // namespace tenon::rehearse
