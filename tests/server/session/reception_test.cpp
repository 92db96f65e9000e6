#include "server/session/reception.h"

#include <cstdint>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/running_server.h"
#include "tests/server/session/scripted_client.h"

namespace tenon::session {
namespace {

using test::rightHandAt;
using test::runInLockstep;
using test::RunningServer;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(SessionServer, ADismissedClientRejoinsWithTheKeyOfItsSeat) {
  RunningServer server({.name = "back", .lockstep = true, .wait_for = {"right"}});
  test::ScriptedClient client("back", wire::LinkProfile::kLockstep);
  const wire::SeatKey key = wire::SeatKey::random();
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}, key));
  const Welcome seat = client.welcome;
  runInLockstep(client, 1, 5);
  client.sendPose(9, rightHandAt(9));
  ASSERT_TRUE(client.receivesUntil([&] { return !client.welcome.accepted; }));
  ASSERT_TRUE(client.join("right, rejoined", Role::kTrainee, {"right"}, key));
  ASSERT_TRUE(client.welcome.accepted) << client.welcome.reason;
  EXPECT_EQ(client.welcome.client, seat.client);
  EXPECT_THAT(client.welcome.hands, ElementsAre(test::kRightHand));
  const Tick next = client.welcome.tick + 1;
  runInLockstep(client, next, next + 20);
}

TEST(SessionServer, WhoEndsBeforeTheirPresenceIsHeardLeavesTheSeat) {
  RunningServer server({.name = "silent", .wait_for = {"right"}});
  test::ScriptedClient silent("silent", wire::LinkProfile::kLan);
  silent.says_presence = false;
  ASSERT_TRUE(silent.join("silent", Role::kTrainee, {"right"}));
  EXPECT_TRUE(silent.receivesUntil([&] { return silent.received("leave", "silent (trainee) has left"); }));
  test::ScriptedClient next("silent", wire::LinkProfile::kLan);
  ASSERT_TRUE(next.join("next", Role::kTrainee, {"right"}));
  EXPECT_TRUE(next.welcome.accepted) << next.welcome.reason;
}

// whatever it does meanwhile, and however often it asks for its seat again
TEST(SessionServer, TheTimeInWhichAPresenceMustBeHeardCountsFromTheSeat) {
  RunningServer server({.name = "busy", .wait_for = {"right", "instructor"}});
  test::ScriptedClient busy("busy", wire::LinkProfile::kLan);
  busy.says_presence = false;
  ASSERT_TRUE(busy.join("busy", Role::kTrainee, {"right"}));
  std::uint32_t seq = 0;
  EXPECT_TRUE(busy.receivesUntil([&] {
    busy.repeatJoin();
    busy.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    busy.command(CommandKind::kSignal);
    return busy.received("leave", "busy (trainee) has left");
  }));
}

TEST(SessionServer, AnInstructorWithoutTheKeyOrWithAnotherOneIsRefusedWithTheReason) {
  RunningServer server({.name = "locked", .wait_for = {"right"}});
  test::ScriptedClient client("locked", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("wrong", Role::kInstructor, {}, wire::SeatKey::random(), {{9}}));
  EXPECT_FALSE(client.welcome.accepted);
  EXPECT_THAT(client.welcome.reason, HasSubstr("the key is not the one of this session"));
  ASSERT_TRUE(client.join("right", Role::kInstructor, {}));
  EXPECT_TRUE(client.welcome.accepted) << client.welcome.reason;
}

TEST(SessionServer, AClientThatKnowsThePublicKeyOfASeatAloneEvictsNobody) {
  RunningServer server({.name = "thief", .wait_for = {"right"}});
  test::ScriptedClient owner("thief", wire::LinkProfile::kLan);
  test::ScriptedClient thief("thief", wire::LinkProfile::kLan);
  const wire::SeatKey seat = wire::SeatKey::random();
  ASSERT_TRUE(owner.join("owner", Role::kTrainee, {"right"}, seat));
  ASSERT_TRUE(owner.welcome.accepted) << owner.welcome.reason;
  ASSERT_TRUE(thief.joinWithSeatOf("thief", seat.publicKey(), {"right"}));
  EXPECT_FALSE(thief.welcome.accepted);
  EXPECT_THAT(thief.welcome.reason, HasSubstr("the seat is another program's"));
  EXPECT_TRUE(owner.welcome.accepted) << "nobody was told to have lost a seat";
  // a request for another session or another life of the server is not heard at all
  thief.ask(
      {.client_guid = "elsewhere", .session = "elsewhere", .server_epoch = thief.announce.server_epoch});
  thief.ask(
      {.client_guid = "elsewhere", .session = "thief", .server_epoch = thief.announce.server_epoch + 1});
  ASSERT_TRUE(thief.join("observer", Role::kObserver, {}));
  EXPECT_EQ(thief.answers_to_others, 0);
}

}  // namespace
}  // namespace tenon::session
