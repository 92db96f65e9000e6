#include <algorithm>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "idl/wire/endpoint.h"
#include "tests/idl/wire/peer.h"

namespace tenon {
namespace {

using Clock = std::chrono::steady_clock;

// these tests fork: gtest runs each in a process of its own under ctest, and DDS is not used before the fork
void echoManifolds(std::uint32_t domain) {
  auto bus = test::participant(domain, LinkProfile::kLockstep);
  Partition session(bus, "s/test");
  auto manifolds = Writer<HandManifold>::open(session, kHandManifold);
  Inbox inbox;
  const auto heard = inbox.on<DeviceInput>(session, kDeviceInput, [&](const DeviceInput& input) {
    HandManifold answer;
    answer.hand = input.hand;
    answer.answers_seq = input.samples[0].seq;
    answer.contacts.resize(kManifoldContacts);
    if (!manifolds->write(answer)) _exit(1);
  });
  if (!heard || !manifolds) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

//   this process                      peer
//     DeviceInput n  ------------->
//                    <-------------  HandManifold that answers n          10,000 times, none may be missing
TEST(TwoProcesses, ExchangeTenThousandLockstepTicksWithoutLoss) {
  constexpr std::uint32_t kTicks = 10'000;
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { echoManifolds(domain); });
  auto bus = test::participant(domain, LinkProfile::kLockstep);
  Partition session(bus, "s/test");
  Inbox inbox;
  std::uint32_t answered = 0;
  std::uint32_t out_of_order = 0;
  bool met = false;
  ASSERT_TRUE(inbox.on<HandManifold>(session, kHandManifold, [&](const HandManifold& manifold) {
    met = true;
    if (manifold.answers_seq == 0) return;
    if (manifold.answers_seq != answered + 1) ++out_of_order;
    answered = manifold.answers_seq;
  }));
  auto inputs = Writer<DeviceInput>::open(session, kDeviceInput);
  ASSERT_TRUE(inputs);
  // that we know the peer does not mean that it knows us: greet with input 0 until it answers
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] {
    DeviceInput greeting;
    greeting.hand = HandId{0};
    return met || !inputs->write(greeting);
  }));
  ASSERT_TRUE(met);

  std::vector<double> rtt_us;
  for (std::uint32_t tick = 1; tick <= kTicks; ++tick) {
    DeviceInput input;
    input.hand = HandId{0};
    input.samples[0].seq = tick;
    const auto sent = Clock::now();
    ASSERT_TRUE(inputs->write(input));
    ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return answered >= tick; })) << "tick " << tick;
    rtt_us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - sent).count());
  }
  EXPECT_EQ(answered, kTicks);
  EXPECT_EQ(out_of_order, 0U);
  std::sort(rtt_us.begin(), rtt_us.end());
  std::printf("round trip p50 %.0f us, p99 %.0f us\n", rtt_us[kTicks / 2], rtt_us[kTicks * 99 / 100]);
}

TEST(TwoProcesses, APersonWhoseProcessIsKilledGoesAway) {
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
  std::string came;
  ClientId went;
  ASSERT_TRUE(inbox.on<Presence>(session, kPresence, [&](const Presence& here) { came = here.name; }));
  ASSERT_TRUE(inbox.onGone<Presence>(session, kPresence, [&](const Presence& gone) { went = gone.client; }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return !came.empty(); }));
  EXPECT_EQ(came, "Ada");
  EXPECT_FALSE(went.valid());
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return went.valid(); }));
  EXPECT_EQ(went, ClientId{4});
}

}  // namespace
}  // namespace tenon
