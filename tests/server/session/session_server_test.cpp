#include "server/session/session_server.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/types/resolution.h"
#include "server/session/journal.h"
#include "server/session/start_condition.h"
#include "tests/server/session/hanging_disk.h"
#include "tests/server/session/running_server.h"
#include "tests/server/session/scripted_client.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;
using test::runInLockstep;
using test::RunningServer;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(SessionServer, ASecondServerOfALiveSessionIsRefusedAndNamesHostAndProcess) {
  RunningServer server({.name = "twice", .wait_for = {"right"}});
  const auto second =
      SessionServer::open(test::smallSession(), {.name = "twice", .domain = test::ownDomain()});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().what, HasSubstr("session 'twice' is served already"));
  EXPECT_THAT(second.error().what, HasSubstr("process " + std::to_string(getpid()) + " on host "));
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

// its disk hangs from before the end on
TEST(SessionServer, TheEndOfARunIsPublishedWithoutTheJournalsDiskWhichASecondSignalLeaves) {
  const auto folder = std::filesystem::temp_directory_path() / ("tenon-hanging-" + std::to_string(getpid()));
  const auto file = folder / "journal.mcap";
  std::atomic<std::uint32_t> signals = 1;  // that which ends the run
  std::atomic<bool> waits = false;
  std::optional<test::HangingDisk> disk;
  {
    SessionOptions options{.name = "hanging", .wait_for = {"observer"}, .journal = file, .signals = &signals};
    options.print = [&](const std::string& line) {
      waits = waits || line.starts_with("waiting for the journal's disk; Ctrl-C ends the server");
    };
    RunningServer server(options);
    test::ScriptedClient client("hanging", wire::LinkProfile::kLan);
    ASSERT_TRUE(client.join("somebody", Role::kObserver, {}));
    ASSERT_TRUE(client.receivesUntil([&] { return client.run.phase == RunPhase::kRunning; }));
    disk.emplace(file);
    server.stop();
    ASSERT_TRUE(client.receivesUntil([&] { return isOver(client.run.phase) && waits; }));
    EXPECT_NE(client.run.final_hash, 0U);
    ++signals;
    const SessionReport report = server.end();
    EXPECT_TRUE(report.left_journal);
    EXPECT_THAT(report.journal_problem, HasSubstr("its disk hangs"));
    EXPECT_EQ(report.run.final_hash, client.run.final_hash);
    disk->release();  // the destructor waits for it
  }
  std::filesystem::remove_all(folder);
}

TEST(SessionServer, InLockstepItSaysThatItWaitsForTheJournalsDiskAndEndsWithoutIt) {
  const auto folder = std::filesystem::temp_directory_path() / ("tenon-waits-" + std::to_string(getpid()));
  const auto file = folder / "journal.mcap";
  std::atomic<std::uint32_t> signals = 0;
  std::atomic<bool> ends = false;
  std::optional<test::HangingDisk> disk;
  {
    SessionOptions options{.name = "waits", .lockstep = true, .wait_for = {"right"}, .journal = file};
    options.signals = &signals;
    options.print = [&](const std::string& line) {
      ends = ends || line.starts_with("waiting for the journal's disk; Ctrl-C ends the server");
    };
    RunningServer server(options);
    test::ScriptedClient client("waits", wire::LinkProfile::kLockstep);
    ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
    runInLockstep(client, 1, 5);
    disk.emplace(file);
    client.sendPose(6, test::rightHandAt(6));
    ASSERT_TRUE(client.receivesUntil([&] {
      return !client.events.empty() &&
             client.events.back().text.starts_with("the session waits for the journal");
    }));
    EXPECT_EQ(client.newest.tick, 5U) << "nobody is ahead of the file";
    ++signals;
    server.stop();
    ASSERT_TRUE(client.receivesUntil([&] { return isOver(client.run.phase) && ends; }));
    ++signals;
    EXPECT_TRUE(server.end().left_journal);
    disk->release();  // the destructor waits for it
  }
  std::filesystem::remove_all(folder);
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
