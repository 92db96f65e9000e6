#include "server/session/server_wire.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/running_server.h"
#include "tests/server/session/scripted_client.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;
using test::rightHandAt;
using test::runInLockstep;
using test::RunningServer;
using ::testing::HasSubstr;

TEST(SessionServer, InvalidInputIsRefusedAndCountedWhileTheSessionContinues) {
  RunningServer server({.name = "intruder", .wait_for = {"right"}});
  test::ScriptedClient client("intruder", wire::LinkProfile::kLan);
  test::ScriptedClient intruder("intruder", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  ASSERT_TRUE(intruder.join("intruder", Role::kInstructor, {"instructor"}));
  ASSERT_TRUE(intruder.welcome.accepted) << intruder.welcome.reason;

  const Pose no_pose(Vector3(std::numeric_limits<double>::quiet_NaN(), 0, 0));
  std::uint32_t seq = 0;
  const auto refusals = [&] {
    return intruder.received("refused", "implausible pose") && intruder.received("refused", "not its own") &&
           intruder.received("refused", "does not have");
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while ((!refusals() || seq < 100) && std::chrono::steady_clock::now() < end) {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    intruder.sendPose(seq, no_pose);
    intruder.dispatch(milliseconds(1));
    intruder.sendPose(seq, Pose(Vector3(0.2, 0, 0.1)), test::kRightHand);
    client.dispatch(milliseconds(1));
    intruder.sendPose(seq, Pose(Vector3(0.2, 0, 0.1)), HandId{4711});
    intruder.dispatch(milliseconds(1));
  }
  EXPECT_TRUE(refusals());
  const int logged = static_cast<int>(std::count_if(intruder.events.begin(), intruder.events.end(),
                                                    [](const EventLog& e) { return e.kind == "refused"; }));
  EXPECT_EQ(logged, 3) << "each refusal is logged once";

  // the other client is not affected
  const Tick before = client.newest.tick;
  EXPECT_TRUE(client.receivesUntil([&] {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    return client.newest.tick > before + 20 && !client.newest.frozen;
  }));
  EXPECT_NEAR(client.newest.X_WO.translation().z(), 0.3, 1e-3);
  const SessionReport report = server.end();
  EXPECT_GE(report.refused_inputs, 3U);
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
}

TEST(SessionServer, SamplesUnderTheIdOfAnotherClientAreRefused) {
  RunningServer server({.name = "forger", .wait_for = {"right"}});
  test::ScriptedClient client("forger", wire::LinkProfile::kLan);
  test::ScriptedClient forger("forger", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("instructor", Role::kAdmin, {"right"}));
  ASSERT_TRUE(forger.join("forger", Role::kObserver, {}));
  forger.welcome = client.welcome;  // client id, hand and epoch can be read on the bus

  std::uint32_t seq = 0;
  const auto refused = [&] {
    return forger.received("refused", "device input under the id of client 1") &&
           forger.received("refused", "command under the id of client 1");
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  forger.command(CommandKind::kStop);
  while ((!refused() || seq < 100) && std::chrono::steady_clock::now() < end) {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    forger.sendPose(seq + 100'000, Pose(Vector3(0.2, 0, 0.1)));
    client.dispatch(milliseconds(1));
    forger.dispatch(milliseconds(1));
  }
  EXPECT_TRUE(refused());
  forger.sendDeparture();
  EXPECT_TRUE(forger.receivesUntil(
      [&] { return forger.received("refused", "departure notice under the id of client 1"); }));
  EXPECT_EQ(std::count_if(forger.events.begin(), forger.events.end(),
                          [](const EventLog& event) { return event.kind == "refused"; }),
            3)
      << "each refusal is logged once";
  const Tick before = client.newest.tick;
  EXPECT_TRUE(client.receivesUntil([&] {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    return client.newest.tick > before + 20;
  })) << "the session continues with the seat's own participant";
  EXPECT_NEAR(client.newest.X_WO.translation().z(), 0.3, 1e-3);
  EXPECT_GE(server.end().refused_inputs, 3U);
}

TEST(SessionServer, TelemetryUnderTheIdOfAnotherClientOrOfNobodyIsRefused) {
  RunningServer server({.name = "telemetry", .wait_for = {"right"}});
  test::ScriptedClient client("telemetry", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("trainee", Role::kTrainee, {"right"}));
  const auto bus = test::participant(test::ownDomain());
  wire::Partition session(bus, wire::sessionPartition("telemetry"));
  auto forger = wire::Writer<Telemetry>::open(session, wire::kTelemetry);
  ASSERT_TRUE(forger) << forger.error().what;
  EXPECT_TRUE(client.receivesUntil([&] {
    (void)forger->write({.client = client.welcome.client});
    (void)forger->write({.client = ClientId{4711}});
    return client.received("refused", "telemetry under the id of client 1") &&
           client.received("refused", "telemetry of unknown client 4711");
  }));
}

// A station whose server was killed measures on until it has its seat again.
TEST(SessionServer, TelemetryOfAStationThatIsNotBackOnItsSeatIsIgnoredAndNotRefused) {
  RunningServer server({.name = "not back", .wait_for = {"right", "observer"}});
  test::ScriptedClient client("not back", wire::LinkProfile::kLan);
  test::ScriptedClient observer("not back", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(observer.join("observer", Role::kObserver, {}));
  client.sendDeparture();
  ASSERT_TRUE(observer.receivesUntil([&] { return observer.received("leave", "trainee"); }));
  const auto bus = test::participant(test::ownDomain());
  wire::Partition session(bus, wire::sessionPartition("not back"));
  auto station = wire::Writer<Telemetry>::open(session, wire::kTelemetry);
  ASSERT_TRUE(station) << station.error().what;
  EXPECT_TRUE(observer.receivesUntil([&] {
    (void)station->write({.client = client.welcome.client});
    (void)station->write({.client = ClientId{4711}});
    return observer.received("refused", "telemetry of unknown client 4711");
  }));
  EXPECT_FALSE(observer.received("refused", "telemetry under the id of client 1"));
}

TEST(SessionServer, InLockstepAClientWithInputAheadOfTheNextTickIsDismissed) {
  RunningServer server({.name = "ahead", .lockstep = true, .wait_for = {"right"}});
  test::ScriptedClient client("ahead", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  runInLockstep(client, 1, 5);
  client.sendPose(9, rightHandAt(9));
  ASSERT_TRUE(client.receivesUntil([&] { return !client.welcome.accepted; }));
  EXPECT_THAT(client.welcome.reason, HasSubstr("input of tick 9 when tick 6 was the next"));
  EXPECT_TRUE(client.receivesUntil([&] { return client.received("leave", "input of tick 9"); }));
}

}  // namespace
}  // namespace tenon::session
