#include <algorithm>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/session.h"
#include "idl/wire/endpoint.h"
#include "tests/idl/wire/peer.h"

namespace tenon::wire {
namespace {

// These tests fork before DDS is used; ctest runs each of them in a process of its own.
void echoManifolds(std::uint32_t domain) {
  auto participant = test::participant(domain, LinkProfile::kLockstep);
  Partition session(participant, "s/test");
  auto manifolds = Writer<HandManifold>::open(session, kHandManifold);
  Inbox inbox;
  const auto added = inbox.on<DeviceInput>(session, kDeviceInput, [&](const DeviceInput& input) {
    HandManifold answer;
    answer.hand = input.hand;
    answer.answers_seq = input.sample.seq;
    answer.contacts.resize(kManifoldContacts);
    if (!manifolds->write(answer)) _exit(1);
  });
  if (!added || !manifolds) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

//   this process                      peer
//     DeviceInput n  ------------->
//                    <-------------  HandManifold that answers n          each tick, without loss
void exchangeLockstepTicks(std::uint32_t ticks) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { echoManifolds(domain); });
  auto participant = test::participant(domain, LinkProfile::kLockstep);
  Partition session(participant, "s/test");
  Inbox inbox;
  std::uint32_t answered = 0;
  std::uint32_t out_of_order = 0;
  bool matched = false;
  ASSERT_TRUE(inbox.on<HandManifold>(session, kHandManifold, [&](const HandManifold& manifold) {
    matched = true;
    if (manifold.answers_seq == 0) return;
    if (manifold.answers_seq != answered + 1) ++out_of_order;
    answered = manifold.answers_seq;
  }));
  auto inputs = Writer<DeviceInput>::open(session, kDeviceInput);
  ASSERT_TRUE(inputs);
  // matching is not symmetric in time: input 0 is sent until the peer answers it
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] {
    DeviceInput first;
    first.hand = HandId{0};
    return matched || !inputs->write(first);
  }));
  ASSERT_TRUE(matched);

  std::vector<double> rtt_us;
  for (std::uint32_t tick = 1; tick <= ticks; ++tick) {
    DeviceInput input;
    input.hand = HandId{0};
    input.sample.seq = tick;
    const auto sent = std::chrono::steady_clock::now();
    ASSERT_TRUE(inputs->write(input));
    ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return answered >= tick; })) << "tick " << tick;
    rtt_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - sent).count());
  }
  EXPECT_EQ(answered, ticks);
  EXPECT_EQ(out_of_order, 0U);
  std::sort(rtt_us.begin(), rtt_us.end());
  std::printf("round trip p50 %.0f us, p99 %.0f us\n", rtt_us[ticks / 2], rtt_us[ticks * 99 / 100]);
}

TEST(TwoProcesses, ExchangeLockstepTicksWithoutLoss) { exchangeLockstepTicks(1000); }
TEST(TwoProcessesNightly, ExchangeTenThousandLockstepTicksWithoutLoss) { exchangeLockstepTicks(10'000); }

TEST(TwoProcesses, ThePresenceOfAKilledProcessIsReportedAsGone) {
  const std::uint32_t domain = test::ownDomain();
  test::Peer peer([domain] {
    Partition session(test::participant(domain), "s/test");
    auto presence = Writer<Presence>::open(session, kPresence);
    Presence here;
    here.client = ClientId{4};
    here.name = "Ada";
    if (!presence || !presence->write(here)) _exit(1);
    while (true) pause();
  });
  Partition session(test::participant(domain), "s/test");
  Inbox inbox;
  std::string present;
  ClientId left;
  ASSERT_TRUE(inbox.on<Presence>(session, kPresence, [&](const Presence& here) { present = here.name; }));
  ASSERT_TRUE(inbox.onGone<Presence>(session, kPresence, [&](const Presence& gone) { left = gone.client; }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return !present.empty(); }));
  EXPECT_EQ(present, "Ada");
  EXPECT_FALSE(left.valid());
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return left.valid(); }));
  EXPECT_EQ(left, ClientId{4});
}

}  // namespace
}  // namespace tenon::wire
