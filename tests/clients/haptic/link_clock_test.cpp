#include "clients/haptic/link_clock.h"

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr std::int64_t kMillisecondOfLink = 1'000'000;  // [ns]

/// A server's clock is 3 s ahead, each direction takes 5 ms; of each `one_in` inputs one is lost.
Telemetry afterSeconds(int seconds, std::uint32_t one_in) {
  LinkClock clock;
  std::uint32_t received = 0;
  std::int64_t now = kMillisecondOfLink;
  for (std::uint32_t seq = 1; seq <= static_cast<std::uint32_t>(seconds) * 1000;
       ++seq, now += kMillisecondOfLink) {
    clock.sent(seq, 2);
    for (int hand = 0; hand < 2; ++hand)
      if ((2 * seq + static_cast<std::uint32_t>(hand)) % one_in != 0) ++received;
    ClockSync sync;
    if (!clock.ask(ClientId{1}, now, sync)) continue;
    sync.server_received_ns = sync.server_sent_ns = now + 3'005 * kMillisecondOfLink;
    sync.inputs_received = received;
    sync.newest_seq = seq;
    clock.receive(sync, now + 10 * kMillisecondOfLink);
  }
  Telemetry telemetry;
  clock.fill(telemetry, now);
  return telemetry;
}

TEST(LinkClock, StatesClockAndLosses) {
  const Telemetry telemetry = afterSeconds(10, 50);
  EXPECT_TRUE(telemetry.clock_known);
  EXPECT_NEAR(telemetry.clock_offset, 3.0, telemetry.clock_error);
  EXPECT_NEAR(telemetry.round_trip, 0.01, 1e-9);
  EXPECT_NEAR(telemetry.inputs_lost, 0.02, 0.002);
}

TEST(LinkClock, ALinkWithoutLossLosesNothing) { EXPECT_EQ(afterSeconds(10, 1U << 30U).inputs_lost, 0.0); }

TEST(LinkClock, WhatANewerInputReplacedAtTheServerIsNotLost) {
  LinkClock clock;
  ClockSync answer{.client = ClientId{1}, .server_received_ns = 1, .server_sent_ns = 1};
  for (std::uint32_t seq = 1; seq <= 3001; ++seq) {
    clock.sent(seq, 1);
    answer.inputs_received = answer.newest_seq = seq;
    answer.inputs_replaced = seq / 10;
    answer.ticks_without_input = seq / 20;
    answer.longest_gap = 0.012;
    if (seq == 1 || seq == 3001) clock.receive(answer, 2);
  }
  Telemetry telemetry;
  clock.fill(telemetry, 2);
  EXPECT_EQ(telemetry.inputs_lost, 0.0);
  EXPECT_DOUBLE_EQ(telemetry.inputs_replaced, 0.1);
  EXPECT_DOUBLE_EQ(telemetry.ticks_without_input, 0.05);
  EXPECT_DOUBLE_EQ(telemetry.input_gap, 0.012);
}

TEST(LinkClock, StatesTheJitterOfTheRoundTripsAndAsksOftenAtFirst) {
  LinkClock clock;
  ClockSync sync;
  int asked = 0;
  for (std::int64_t now = kMillisecondOfLink; now < 1000 * kMillisecondOfLink; now += kMillisecondOfLink) {
    if (!clock.ask(ClientId{1}, now, sync)) continue;
    sync.server_received_ns = sync.server_sent_ns = now + 5 * kMillisecondOfLink;
    // every fifth takes 4 ms longer
    clock.receive(sync, now + (++asked % 5 == 0 ? 14 : 10) * kMillisecondOfLink);
  }
  EXPECT_GE(asked, 30) << "in the first second";
  Telemetry telemetry;
  clock.fill(telemetry, 1000 * kMillisecondOfLink);
  EXPECT_NEAR(telemetry.trip_jitter, 0.004, 1e-9);
}

// a partition of 3 s, then either a rejoin or the server's own statement of the gap
TEST(LinkClock, WhatIsNotReceivedInAnInterruptionIsNoLossOfTheLink) {
  for (const bool rejoins : {true, false}) {
    LinkClock clock;
    ClockSync answer{.client = ClientId{1}, .server_received_ns = 1, .server_sent_ns = 1};
    for (std::uint32_t seq = 1; seq <= 12'000; ++seq) {
      clock.sent(seq, 1);
      if (seq > 3000 && seq <= 6000) continue;
      ++answer.inputs_received;
      answer.newest_seq = seq;
      answer.longest_gap = !rejoins && seq > 6000 && seq < 8000 ? 3.0 : 0.002;
      if (rejoins && seq == 6001) clock.interrupted();
      if (seq % 200 == 0) clock.receive(answer, 2);
      Telemetry telemetry;
      clock.fill(telemetry, 2);
      ASSERT_EQ(telemetry.inputs_lost, 0.0) << seq;
    }
    EXPECT_TRUE(clock.lossKnown());
  }
}

TEST(LinkClock, AnotherServerBeginsAnew) {
  LinkClock clock;
  for (std::uint32_t seq = 1; seq <= 5000; ++seq) clock.sent(seq, 1);
  const auto answer = [&](std::uint32_t received, std::uint32_t seq) {
    ClockSync sync{.client = ClientId{1}, .server_received_ns = 1, .server_sent_ns = 1};
    sync.inputs_received = received;
    sync.newest_seq = seq;
    clock.receive(sync, 2);
  };
  answer(1000, 1000);
  answer(10, 4000);  // it has received ten since its start
  answer(1010, 5000);
  Telemetry telemetry;
  clock.fill(telemetry, 2);
  EXPECT_EQ(telemetry.inputs_lost, 0.0);
}

}  // namespace
}  // namespace tenon::haptic
