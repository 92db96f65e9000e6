#include "idl/wire/membership.h"

#include <chrono>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/idl/wire/peer.h"

namespace tenon {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A server of a process of its own that knows one seat: who asks for hand "taken" is refused, and whoever
/// says hello by an event is taken out once.
void runDoor(std::uint32_t domain) {
  auto bus = test::participant(domain);
  Partition lobby(bus, kLobby);
  Partition session(bus, sessionPartition("test"));
  auto announces = Writer<SessionAnnounce>::open(lobby, kSessionAnnounce);
  auto welcomes = Writer<Welcome>::open(lobby, kWelcome);
  if (!announces || !announces->write({.session = "test", .server_epoch = 7})) _exit(1);
  Inbox inbox;
  std::uint32_t asked = 0;
  std::string guid;
  auto heard = inbox.on<Join>(lobby, kJoin, [&](const Join& join) {
    guid = join.client_guid;
    Welcome answer{.client_guid = guid, .server_epoch = 7};
    if (!join.hands.empty() && join.hands.front() == "taken") {
      answer.reason = "that hand is taken";
    } else {
      answer.accepted = true;
      answer.client = ClientId{1};
      answer.token = join.token.empty() ? "token of the first" : join.token + ", again";
      answer.tick = ++asked;
    }
    if (!welcomes->write(answer)) _exit(1);
  });
  if (heard) {
    heard = inbox.on<ClientEvent>(session, kClientEvent, [&](const ClientEvent&) {
      (void)welcomes->write({.client_guid = guid, .reason = "too loud", .client = ClientId{1}});
    });
  }
  if (!heard) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

MembershipWishes wishes(std::uint32_t domain) {
  return {.domain = domain, .person = "Ada", .role = Role::kTrainee, .patience = std::chrono::seconds(60)};
}

//   this process: find, join        lobby        peer: announce, welcome
TEST(Membership, FindsTheSessionOfAnotherProcessAndJoins) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { runDoor(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(wishes(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  EXPECT_EQ((*member)->sessionName(), "test");
  int looks = 0;
  const auto joined = (*member)->join(stop, [&] { ++looks; });
  ASSERT_TRUE(joined) << joined.error().what;
  EXPECT_GT(looks, 0) << "somebody who records listens while he waits";
  EXPECT_EQ((*member)->welcome().client, ClientId{1});
  EXPECT_EQ((*member)->welcome().server_epoch, 7U);
  EXPECT_FALSE((*member)->lost());
}

TEST(Membership, ARefusalIsTheServersReason) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { runDoor(domain); });
  const std::atomic<bool> stop = false;
  MembershipWishes wish = wishes(domain);
  wish.hands = {"taken"};
  auto member = Membership::find(wish, stop);
  ASSERT_TRUE(member) << member.error().what;
  const auto joined = (*member)->join(stop);
  ASSERT_FALSE(joined);
  EXPECT_THAT(joined.error().what, HasSubstr("refuses: that hand is taken"));
}

TEST(Membership, WhoIsTakenOutComesBackWithTheToken) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { runDoor(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(wishes(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  ASSERT_TRUE((*member)->join(stop));
  Inbox inbox;
  ASSERT_TRUE((*member)->watch(inbox));
  auto events = Writer<ClientEvent>::open((*member)->session(), kClientEvent);
  ASSERT_TRUE(events);
  ASSERT_TRUE(test::dispatchUntil(
      inbox, [&] { return events->matchedReaders() == 1 && inbox.matchedWriters() >= 2; }));
  ASSERT_TRUE(events->write({.client = ClientId{1}, .seq = 1, .kind = "hello", .text = "HELLO"}));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->lost().has_value(); }));
  EXPECT_THAT(*(*member)->lost(), HasSubstr("too loud"));
  EXPECT_FALSE((*member)->serverIsGone());

  const auto back = (*member)->comeBack(stop, [&] { inbox.dispatch(milliseconds(0)); });
  ASSERT_TRUE(back) << back.error().what;
  EXPECT_EQ((*member)->welcome().token, "token of the first, again");
  inbox.dispatch(milliseconds(50));
  EXPECT_FALSE((*member)->lost());
}

TEST(Membership, AServerThatIsKilledIsGoneAndWhoHasNoneSaysSo) {
  const std::uint32_t domain = test::ownDomain();
  test::Peer peer([domain] { runDoor(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(wishes(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  ASSERT_TRUE((*member)->join(stop));
  Inbox inbox;
  ASSERT_TRUE((*member)->watch(inbox));
  bool announced = false;
  ASSERT_TRUE(inbox.on<SessionAnnounce>((*member)->lobby(), kSessionAnnounce,
                                        [&](const SessionAnnounce&) { announced = true; }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return announced; }));
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->serverIsGone(); }));
  EXPECT_THAT(*(*member)->lost(), HasSubstr("'test' is gone"));

  MembershipWishes nobody = wishes(domain);
  nobody.session = "nowhere";
  nobody.patience = std::chrono::seconds(0);
  const auto none = Membership::find(nobody, stop);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().what, HasSubstr("no server announced session 'nowhere'"));
  EXPECT_THAT(none.error().what, HasSubstr("tenon serve"));
}

// two programs of one process write the same topic: what they claim is equal, who they are is not
TEST(Origin, IsTheWritersOwnWhateverTheMessageClaims) {
  const std::uint32_t domain = test::ownDomain();
  auto server_bus = test::participant(domain);
  auto ada_bus = test::participant(domain);
  auto rogue_bus = test::participant(domain);
  Partition room(server_bus, "s/test");
  Partition ada_room(ada_bus, "s/test");
  Partition rogue_room(rogue_bus, "s/test");
  auto ada = Writer<Command>::open(ada_room, kCommand);
  auto rogue = Writer<Command>::open(rogue_room, kCommand);
  Inbox inbox;
  std::vector<Origin> origins;
  ASSERT_TRUE(inbox.onFrom<Command>(room, kCommand,
                                    [&](const Command&, const Origin& from) { origins.push_back(from); }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return inbox.matchedWriters() == 2; }));
  const Command same{.client = ClientId{1}, .id = 1};
  ASSERT_TRUE(ada->write(same));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return origins.size() == 1; }));
  ASSERT_TRUE(rogue->write(same));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return origins.size() == 2; }));
  EXPECT_EQ(origins[0], ada_bus->origin());
  EXPECT_EQ(origins[1], rogue_bus->origin());
  EXPECT_NE(origins[0], origins[1]);
  EXPECT_TRUE(origins[0].known());
}

}  // namespace
}  // namespace tenon
