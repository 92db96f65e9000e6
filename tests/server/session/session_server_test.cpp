#include "server/session/session_server.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <limits>
#include <optional>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/types/resolution.h"
#include "server/session/journal.h"
#include "server/session/start_condition.h"
#include "tests/server/session/scripted_client.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;
using test::kRightHand;
using test::playInput;
using test::ScriptedClient;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A server that runs in a thread of its own.
class RunningServer {
 public:
  explicit RunningServer(SessionOptions options, const std::string& scenario = test::twoHandedScenario())
      : loaded_(test::smallSession(scenario)), session_(options.name) {
    options.domain = test::ownDomain();
    if (!options.key) options.key = test::kTestKey;
    auto opened = SessionServer::open(loaded_, std::move(options));
    if (!opened) throw std::runtime_error(opened.error().what);
    server_ = std::move(*opened);
    thread_ = std::thread([this] { report_.emplace(server_->run(stop_)); });
  }
  ~RunningServer() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  SessionReport end(bool by_stop = true) {
    if (by_stop) stop_ = true;
    thread_.join();
    EXPECT_TRUE(*report_);
    return **report_;
  }
  [[nodiscard]] const LoadedScene& loaded() const { return loaded_; }

 private:
  LoadedScene loaded_;
  std::string session_;
  std::unique_ptr<SessionServer> server_;
  std::atomic<bool> stop_ = false;
  std::optional<Result<SessionReport>> report_;
  std::thread thread_;
};

Pose rightHandAt(Tick tick) { return test::playInput(tick).readings[0].X_WH; }

/// Sends the inputs of the right hand for ticks `from` to `to`, each after the manifold of the one before.
void runInLockstep(test::ScriptedClient& client, Tick from, Tick to) {
  for (Tick tick = from; tick <= to; ++tick) {
    client.sendPose(static_cast<std::uint32_t>(tick), rightHandAt(tick));
    ASSERT_TRUE(client.receivesUntil([&] { return client.newest.tick >= tick; }))
        << "no answer to tick " << tick;
    ASSERT_EQ(client.newest.tick, tick) << "one tick per input";
    ASSERT_EQ(client.newest.answers_seq, tick);
  }
}

TEST(SessionServer, InLockstepEveryInputIsOneTick) {
  RunningServer server({.name = "lockstep", .lockstep = true, .wait_for = {"right"}});
  test::ScriptedClient client("lockstep", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  ASSERT_TRUE(client.welcome.accepted) << client.welcome.reason;
  EXPECT_EQ(client.announce.session, "lockstep");
  EXPECT_EQ(client.announce.title, "Small");
  EXPECT_TRUE(client.announce.lockstep);
  EXPECT_TRUE(client.welcome.lockstep);
  EXPECT_EQ(client.welcome.server_epoch, client.announce.server_epoch);
  EXPECT_EQ(client.welcome.tick, 0U);
  EXPECT_EQ(client.announce.pid, static_cast<std::uint32_t>(getpid()));
  EXPECT_NE(client.announce.host, "");

  runInLockstep(client, 1, 200);
  const SessionReport report = server.end();
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
  EXPECT_EQ(report.run.tick, 200U);
  EXPECT_EQ(report.refused_inputs, 0U);
  EXPECT_TRUE(client.receivesUntil([&] { return client.run.phase == RunPhase::kStopped; }));
  EXPECT_EQ(client.run.final_hash, report.run.final_hash);

  // the same inputs without a network give the same hash
  SessionSimulation simulation = test::SessionRig::makeSimulation(server.loaded(), 1, {test::kRightHand});
  for (Tick tick = 1; tick <= 200; ++tick) {
    TickInput input{.tick = tick};
    if (tick == 1) input.changes.push_back({.kind = ChangeKind::kAttach, .hand = test::kRightHand});
    HandReading reading = test::playInput(tick).readings[0];
    reading.X_WH = rounded(reading.X_WH);  // as over the wire
    input.readings.push_back(reading);
    simulation.tick(input);
  }
  EXPECT_EQ(simulation.hash(), report.run.final_hash);
}

TEST(SessionServer, TheJournalOfASessionResimulatesToEqualHashes) {
  const auto file =
      std::filesystem::temp_directory_path() / ("tenon-server-test-" + std::to_string(getpid()) + ".mcap");
  RunningServer server({.name = "journal", .lockstep = true, .wait_for = {"right"}, .journal = file});
  test::ScriptedClient client("journal", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  runInLockstep(client, 1, 150);
  const SessionReport report = server.end();
  SessionSimulation simulation = test::SessionRig::makeSimulation(server.loaded());
  const auto again = resimulate(file, simulation);
  std::filesystem::remove(file);
  ASSERT_TRUE(again) << again.error().what;
  EXPECT_EQ(again->last, 150U);
  EXPECT_FALSE(again->first_difference);
  EXPECT_EQ(again->final_hash, report.run.final_hash);
}

TEST(SessionServer, AnInstructorStopsTheRun) {
  RunningServer server({.name = "end", .lockstep = true, .wait_for = {"instructor"}});
  test::ScriptedClient client("end", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("instructor", Role::kInstructor, {"instructor"}));
  client.command(CommandKind::kStop);
  ASSERT_TRUE(client.receivesUntil([&] { return client.ack.id == 1; }));
  EXPECT_TRUE(client.ack.accepted) << client.ack.reason;
  client.sendPose(1, Pose(Vector3(-0.3, 0, 0.3)));
  ASSERT_TRUE(client.receivesUntil([&] { return client.run.phase == RunPhase::kStopped; }));
  const SessionReport report = server.end(false);
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
  EXPECT_EQ(report.run.tick, 1U);
}

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
           client.received("refused", "telemetry of client 4711, which nobody is");
  }));
}

TEST(SessionServer, WithoutAFileForTheEmergencyStopThatIsSaid) {
  RunningServer server({.name = "no file", .wait_for = {"right"}});
  test::ScriptedClient client("no file", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("trainee", Role::kTrainee, {"right"}));
  EXPECT_TRUE(client.receivesUntil(
      [&] { return client.received("emergency stop", "will not stand after a restart"); }));
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

TEST(SessionServer, AnyClientEngagesAnEmergencyStopAndOnlyTheInstructorClearsIt) {
  RunningServer server({.name = "emergency", .wait_for = {"right"}});
  test::ScriptedClient trainee("emergency", wire::LinkProfile::kLan);
  test::ScriptedClient instructor("emergency", wire::LinkProfile::kLan);
  test::ScriptedClient admin("emergency", wire::LinkProfile::kLan);
  ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(instructor.join("instructor", Role::kInstructor, {}));
  ASSERT_TRUE(admin.join("admin", Role::kAdmin, {}));
  trainee.emergencyStop();
  trainee.emergencyStop();
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.stops.standing().size() == 2; }));
  EXPECT_TRUE(
      trainee.receivesUntil([&] { return trainee.received("emergency stop", "engaged by trainee"); }));

  trainee.clearStop(2);
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.ack.id == 1; }));
  EXPECT_FALSE(trainee.ack.accepted);
  admin.clearStop(2);
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.ack.id == 1; }));
  EXPECT_THAT(admin.ack.reason, HasSubstr("an instructor is present"));

  instructor.clearStop(2);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  EXPECT_TRUE(instructor.ack.accepted) << instructor.ack.reason;
  EXPECT_TRUE(trainee.receivesUntil([&] { return trainee.stops.cleared().size() == 2; }));
  EXPECT_FALSE(trainee.stops.engaged());
  instructor.clearStop(2);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 2; }));
  EXPECT_EQ(instructor.ack.reason, "there is no emergency stop");

  trainee.emergencyStop();
  EXPECT_TRUE(trainee.receivesUntil([&] { return trainee.stops.engaged(); })) << "a new raise is not cleared";
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

TEST(SessionServer, ARaiseThatWhoClearsHasNotSeenStands) {
  RunningServer server({.name = "unseen", .wait_for = {"right"}});
  test::ScriptedClient trainee("unseen", wire::LinkProfile::kLan);
  test::ScriptedClient instructor("unseen", wire::LinkProfile::kLan);
  ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(instructor.join("instructor", Role::kInstructor, {}));
  trainee.emergencyStop();
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.newest_raise.number == 1; }));
  EXPECT_EQ(instructor.newest_raise.reason, "a test");
  trainee.emergencyStop();
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.newest_raise.number == 2; }));

  instructor.clearStop(1);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  EXPECT_EQ(instructor.ack.refusal, Refusal::kRaisedAgain);
  EXPECT_THAT(instructor.ack.reason,
              HasSubstr("a newer raise stands than those you were told of, by trainee"));
  EXPECT_TRUE(trainee.stops.cleared().empty());

  instructor.clearStop(9);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 2; }));
  EXPECT_EQ(instructor.ack.refusal, Refusal::kRaisedAgain) << "of another life of the server";
  instructor.clearStop(2);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 3; }));
  EXPECT_TRUE(instructor.ack.accepted) << instructor.ack.reason;
  EXPECT_TRUE(trainee.receivesUntil([&] { return !trainee.stops.engaged(); }));
  EXPECT_TRUE(trainee.receivesUntil([&] { return trainee.newest_raise.standing == 0; }));
}

// in lockstep no tick comes between the two
TEST(SessionServer, ACommandWhoseTickAStopForestallsIsToldWithItsSender) {
  RunningServer server({.name = "dropped", .lockstep = true, .wait_for = {"right"}});
  test::ScriptedClient trainee("dropped", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(trainee.join("right", Role::kTrainee, {"right"}));
  runInLockstep(trainee, 1, 3);
  test::ScriptedClient instructor("dropped", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(instructor.join("Ada", Role::kInstructor, {}));
  instructor.command(CommandKind::kSkipStep);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  ASSERT_TRUE(instructor.ack.accepted) << instructor.ack.reason;
  instructor.emergencyStop();
  ASSERT_TRUE(
      instructor.receivesUntil([&] { return instructor.received("emergency stop", "engaged by Ada"); }));
  runInLockstep(trainee, 4, 4);
  EXPECT_TRUE(instructor.receivesUntil(
      [&] { return instructor.received("dropped", "Ada: skip (an emergency stop came before its tick)"); }));
}

TEST(SessionServer, WithoutAnInstructorAnAdminClearsTheEmergencyStopAndTheRunStaysPaused) {
  RunningServer server({.name = "alone", .lockstep = true, .wait_for = {"right"}});
  test::ScriptedClient trainee("alone", wire::LinkProfile::kLockstep);
  test::ScriptedClient admin("alone", wire::LinkProfile::kLockstep);
  ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(admin.join("admin", Role::kAdmin, {}));
  runInLockstep(trainee, 1, 3);
  trainee.emergencyStop();
  ASSERT_TRUE(
      trainee.receivesUntil([&] { return trainee.received("emergency stop", "engaged by trainee"); }));
  runInLockstep(trainee, 4, 6);
  EXPECT_TRUE(trainee.newest.frozen);
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.stops.engaged(); }));
  admin.clearStop(1);
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.ack.id == 1; }));
  EXPECT_TRUE(admin.ack.accepted) << admin.ack.reason;
  runInLockstep(trainee, 7, 9);
  EXPECT_TRUE(trainee.newest.frozen) << "the stop is cleared, the run is paused";
  admin.command(CommandKind::kResume);
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.ack.id == 2; }));
  EXPECT_TRUE(admin.ack.accepted) << admin.ack.reason;
  runInLockstep(trainee, 10, 12);
  EXPECT_FALSE(trainee.newest.frozen);
}

TEST(SessionServer, AnEmergencyStopStandsAfterARestartUntilItIsCleared) {
  const auto file = std::filesystem::temp_directory_path() / ("tenon-stop-test-" + std::to_string(getpid()));
  std::filesystem::remove(file);
  const auto options = [&] {
    return SessionOptions{.name = "restart", .wait_for = {"right"}, .stop_file = file};
  };
  EmergencyStop raised;
  {
    RunningServer server(options());
    test::ScriptedClient trainee("restart", wire::LinkProfile::kLan);
    ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
    trainee.emergencyStop();
    ASSERT_TRUE(
        trainee.receivesUntil([&] { return trainee.received("emergency stop", "engaged by trainee"); }));
    raised = trainee.stops.standing().begin()->second;
  }
  {
    RunningServer server(options());
    test::ScriptedClient late("restart", wire::LinkProfile::kLan);
    ASSERT_TRUE(late.join("late", Role::kInstructor, {}));
    ASSERT_TRUE(late.receivesUntil([&] { return late.stops.engaged(); }));
    EXPECT_EQ(late.stops.standing().begin()->first.client_guid, raised.client_guid);
    late.clearStop(1);
    ASSERT_TRUE(late.receivesUntil([&] { return late.ack.id == 1; }));
    EXPECT_TRUE(late.ack.accepted) << late.ack.reason;
  }
  RunningServer server(options());
  test::ScriptedClient last("restart", wire::LinkProfile::kLan);
  ASSERT_TRUE(last.join("last", Role::kInstructor, {}));
  ASSERT_TRUE(last.receivesUntil([&] { return last.stops.cleared().size() == 1; }));
  EXPECT_FALSE(last.stops.engaged());
  std::filesystem::remove(file);
}

TEST(SessionServer, ASecondServerOfALiveSessionIsRefusedAndNamesHostAndProcess) {
  RunningServer server({.name = "twice", .wait_for = {"right"}});
  const auto second =
      SessionServer::open(test::smallSession(), {.name = "twice", .domain = test::ownDomain()});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().what, HasSubstr("session 'twice' is served already"));
  EXPECT_THAT(second.error().what, HasSubstr("process " + std::to_string(getpid()) + " on host "));
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

TEST(SessionServer, AStopCommandEndsASessionThatStillWaitsForPeople) {
  RunningServer server({.name = "waiting", .wait_for = {"right"}});
  test::ScriptedClient instructor("waiting", wire::LinkProfile::kLan);
  ASSERT_TRUE(instructor.join("instructor", Role::kInstructor, {}));
  instructor.command(CommandKind::kFulfilled);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  EXPECT_FALSE(instructor.ack.accepted) << "it would not take effect";
  EXPECT_THAT(instructor.ack.reason, HasSubstr("waits for people"));
  instructor.emergencyStop();
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.run.emergency_stop; })) << "without a tick";
  EXPECT_EQ(instructor.run.phase, RunPhase::kWaitingForPeople);
  EXPECT_EQ(instructor.run.open_commands & bitOf(CommandKind::kFulfilled), 0U);
  EXPECT_NE(instructor.run.open_commands & bitOf(CommandKind::kStop), 0U);
  instructor.command(CommandKind::kStop);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 2; }));
  EXPECT_TRUE(instructor.ack.accepted) << instructor.ack.reason;
  EXPECT_EQ(server.end(false).run.phase, RunPhase::kStopped);
}

// the run fails 0.1 s after it began, while the wire thread, which prints, is held up
TEST(SessionServer, TheEndOfARunIsPublishedWhenTheWireIsBehindByMoreThanItsQueue) {
  SessionOptions options{.name = "behind", .wait_for = {"observer"}};
  options.print = [](const std::string& line) {
    if (line == "run: running") std::this_thread::sleep_for(milliseconds(1500));
  };
  RunningServer server(
      options, test::with(test::twoHandedScenario(), "- name: take\n", "- name: take\n    timeout: 0.1 s\n"));
  test::ScriptedClient client("behind", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("somebody", Role::kObserver, {}));
  ASSERT_TRUE(client.receivesUntil([&] { return isOver(client.run.phase); }));
  EXPECT_EQ(client.run.phase, RunPhase::kFailed);
  EXPECT_THAT(client.run.reason, HasSubstr("not done in time"));
  const SessionReport report = server.end(/*by_stop=*/false);
  EXPECT_GT(report.dropped_outputs, 0U) << "the wire was behind";
  EXPECT_EQ(report.run.final_hash, client.run.final_hash);
  EXPECT_EQ(report.run.reason, client.run.reason);
}

TEST(SessionServer, RefusesToWaitForAnUnknownHandOrRole) {
  const auto server =
      SessionServer::open(test::smallSession(), {.domain = test::ownDomain(), .wait_for = {"third"}});
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().what, HasSubstr("'third'"));
}

TEST(SessionServer, ByDefaultWaitsForEveryHandOfTheTrainee) {
  const LoadedScene loaded = test::smallSession();
  EXPECT_THAT(traineeHands(*loaded.scenario), ElementsAre(test::kRightHand, test::kLeftHand));
}

}  // namespace
}  // namespace tenon::session
