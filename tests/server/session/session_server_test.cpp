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

#include "server/session/journal.h"
#include "tests/server/session/scripted_client.h"
#include "tests/server/session/small_session.h"

#if defined(__SANITIZE_THREAD__)
// Cyclone DDS is not built for the thread sanitizer, which does not see its atomic counts of references.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() { return "race:libddsc.so\n"; }
#endif

namespace tenon {
namespace {

using std::chrono::milliseconds;
using test::kRightHand;
using test::play;
using test::ScriptedClient;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A server in a thread of its own, for one test.
class Running {
 public:
  explicit Running(SessionOptions options) : session_(options.name) {
    options.domain = test::ownDomain();
    auto opened = SessionServer::open(loaded_, std::move(options));
    if (!opened) throw std::runtime_error(opened.error().what);
    server_ = std::move(*opened);
    thread_ = std::thread([this] { report_.emplace(server_->run(stop_)); });
  }
  ~Running() {
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
  LoadedScene loaded_ = test::smallSession();
  std::string session_;
  std::unique_ptr<SessionServer> server_;
  std::atomic<bool> stop_ = false;
  std::optional<Result<SessionReport>> report_;
  std::thread thread_;
};

Pose rightHandAt(Tick tick) { return play(tick).readings[0].X_WH; }

/// Moves the right hand through the play from tick `from` to `to`, each input answered by a manifold.
void playInLockstep(ScriptedClient& client, Tick from, Tick to) {
  for (Tick tick = from; tick <= to; ++tick) {
    client.sendPose(static_cast<std::uint32_t>(tick), rightHandAt(tick));
    ASSERT_TRUE(client.hears([&] { return client.newest.tick >= tick; })) << "no answer to tick " << tick;
    ASSERT_EQ(client.newest.tick, tick) << "not a tick more than there were inputs";
    ASSERT_EQ(client.newest.answers_seq, tick);
  }
}

TEST(SessionServer, InLockstepEveryInputIsOneTickUntilItIsStopped) {
  Running server({.name = "lockstep", .lockstep = true, .wait_for = {"right"}});
  ScriptedClient client("lockstep", LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  ASSERT_TRUE(client.welcome.accepted) << client.welcome.reason;
  EXPECT_EQ(client.announce.session, "lockstep");
  EXPECT_EQ(client.announce.title, "Small");
  EXPECT_TRUE(client.announce.lockstep);
  EXPECT_TRUE(client.welcome.lockstep);
  EXPECT_EQ(client.welcome.server_epoch, client.announce.server_epoch);
  EXPECT_EQ(client.welcome.tick, 0U);
  EXPECT_TRUE(client.hears([&] { return client.announce.free_hands.size() == 2; }));
  EXPECT_THAT(client.announce.free_hands, ElementsAre("instructor", "left"));

  playInLockstep(client, 1, 200);
  const SessionReport report = server.end();
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
  EXPECT_EQ(report.run.tick, 200U);
  EXPECT_EQ(report.refused_inputs, 0U);
  EXPECT_TRUE(client.hears([&] { return client.run.phase == RunPhase::kStopped; }));
  EXPECT_EQ(client.run.final_hash, report.run.final_hash);

  // the network adds nothing: the same inputs in one thread give the same bits
  Exercise exercise = test::Stage::makeExercise(server.loaded(), 1, {kRightHand});
  for (Tick tick = 1; tick <= 200; ++tick) {
    TickInput input{.tick = tick};
    if (tick == 1) input.changes.push_back({.kind = ChangeKind::kAttach, .hand = kRightHand});
    input.readings.push_back(play(tick).readings[0]);
    exercise.tick(input);
  }
  EXPECT_EQ(exercise.hash(), report.run.final_hash);
}

TEST(SessionServer, JournalsASessionThatRunsAgain) {
  const auto file =
      std::filesystem::temp_directory_path() / ("tenon-server-test-" + std::to_string(getpid()) + ".mcap");
  Running server({.name = "journal", .lockstep = true, .wait_for = {"right"}, .journal = file});
  ScriptedClient client("journal", LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  playInLockstep(client, 1, 150);
  const SessionReport report = server.end();
  Exercise exercise = test::Stage::makeExercise(server.loaded());
  const auto again = rerun(file, exercise);
  std::filesystem::remove(file);
  ASSERT_TRUE(again) << again.error().what;
  EXPECT_EQ(again->last, 150U);
  EXPECT_FALSE(again->first_difference);
  EXPECT_EQ(again->final_hash, report.run.final_hash);
}

TEST(SessionServer, AnInstructorEndsTheRun) {
  Running server({.name = "end", .lockstep = true, .wait_for = {"instructor"}});
  ScriptedClient client("end", LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("teacher", Role::kInstructor, {"instructor"}));
  client.command(CommandKind::kStop);
  ASSERT_TRUE(client.hears([&] { return client.ack.id == 1; }));
  EXPECT_TRUE(client.ack.accepted) << client.ack.reason;
  client.sendPose(1, Pose(Vector3(-0.3, 0, 0.3)));
  ASSERT_TRUE(client.hears([&] { return client.run.phase == RunPhase::kStopped; }));
  const SessionReport report = server.end(false);
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
  EXPECT_EQ(report.run.tick, 1U);
}

TEST(SessionServer, ARogueIsRefusedAndCountedWhileTheSessionGoesOn) {
  Running server({.name = "rogue", .wait_for = {"right"}});
  ScriptedClient client("rogue", LinkProfile::kLan);
  ScriptedClient rogue("rogue", LinkProfile::kLan);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  ASSERT_TRUE(rogue.join("rogue", Role::kInstructor, {"instructor"}));
  ASSERT_TRUE(rogue.welcome.accepted) << rogue.welcome.reason;

  const Pose no_pose(Vector3(std::numeric_limits<double>::quiet_NaN(), 0, 0));
  std::uint32_t seq = 0;
  const auto refusals = [&] {
    return rogue.heard("refused", "not a pose") && rogue.heard("refused", "not its own") &&
           rogue.heard("refused", "does not have");
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while ((!refusals() || seq < 100) && std::chrono::steady_clock::now() < end) {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    rogue.sendPose(seq, no_pose);
    rogue.listen(milliseconds(1));
    rogue.sendPose(seq, Pose(Vector3(0.2, 0, 0.1)), kRightHand);
    client.listen(milliseconds(1));
    rogue.sendPose(seq, Pose(Vector3(0.2, 0, 0.1)), HandId{4711});
    rogue.listen(milliseconds(1));
  }
  EXPECT_TRUE(refusals());
  const int told = static_cast<int>(std::count_if(rogue.events.begin(), rogue.events.end(),
                                                  [](const EventLog& e) { return e.kind == "refused"; }));
  EXPECT_EQ(told, 3) << "each kind is told once, not a thousand times a second";

  // the others have noticed nothing
  const Tick heard = client.newest.tick;
  EXPECT_TRUE(client.hears([&] {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    return client.newest.tick > heard + 20 && !client.newest.frozen;
  }));
  EXPECT_NEAR(client.newest.X_WO.translation().z(), 0.3, 1e-3);
  const SessionReport report = server.end();
  EXPECT_GE(report.refused_inputs, 3U);
  EXPECT_EQ(report.run.phase, RunPhase::kStopped);
}

TEST(SessionServer, AForgerOfAnotherOnesIdIsRefusedWhateverItSends) {
  Running server({.name = "forger", .wait_for = {"right"}});
  ScriptedClient client("forger", LinkProfile::kLan);
  ScriptedClient forger("forger", LinkProfile::kLan);
  ASSERT_TRUE(client.join("teacher", Role::kAdmin, {"right"}));
  ASSERT_TRUE(forger.join("forger", Role::kObserver, {}));
  forger.welcome = client.welcome;  // client id, hand and epoch: all that is on the bus to be read

  std::uint32_t seq = 0;
  const auto refused = [&] {
    return forger.heard("refused", "device input under the id of client 1") &&
           forger.heard("refused", "command under the id of client 1");
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  forger.command(CommandKind::kStop);
  while ((!refused() || seq < 100) && std::chrono::steady_clock::now() < end) {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    forger.sendPose(seq + 100'000, Pose(Vector3(0.2, 0, 0.1)));
    client.listen(milliseconds(1));
    forger.listen(milliseconds(1));
  }
  EXPECT_TRUE(refused());
  forger.sayGoodBye();
  EXPECT_TRUE(forger.hears([&] { return forger.heard("refused", "good-bye under the id of client 1"); }));
  EXPECT_EQ(std::count_if(forger.events.begin(), forger.events.end(),
                          [](const EventLog& event) { return event.kind == "refused"; }),
            3)
      << "each kind is told once";
  const Tick heard = client.newest.tick;
  EXPECT_TRUE(client.hears([&] {
    client.sendPose(++seq, Pose(Vector3(0.2, 0, 0.3)));
    return client.newest.tick > heard + 20;
  })) << "the session goes on, and with whom it belongs to";
  EXPECT_NEAR(client.newest.X_WO.translation().z(), 0.3, 1e-3);
  EXPECT_GE(server.end().refused_inputs, 3U);
}

TEST(SessionServer, InLockstepAnInputAheadOfItsTickEndsInDismissalAtOnce) {
  Running server({.name = "ahead", .lockstep = true, .wait_for = {"right"}});
  ScriptedClient client("ahead", LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  playInLockstep(client, 1, 5);
  client.sendPose(9, rightHandAt(9));
  ASSERT_TRUE(client.hears([&] { return !client.welcome.accepted; }));
  EXPECT_THAT(client.welcome.reason, HasSubstr("input of tick 9 when tick 6 was the next"));
  EXPECT_TRUE(client.hears([&] { return client.heard("leave", "input of tick 9"); }));
}

TEST(SessionServer, WhoWasTakenOutAndGoesOnIsToldAndComesBackByToken) {
  Running server({.name = "back", .lockstep = true, .wait_for = {"right"}});
  ScriptedClient client("back", LinkProfile::kLockstep);
  ASSERT_TRUE(client.join("right", Role::kTrainee, {"right"}));
  const Welcome seat = client.welcome;
  playInLockstep(client, 1, 5);
  client.sendPose(9, rightHandAt(9));
  ASSERT_TRUE(client.hears([&] { return !client.welcome.accepted; }));
  ASSERT_TRUE(client.join("right, again", Role::kTrainee, {"right"}, seat.token));
  ASSERT_TRUE(client.welcome.accepted) << client.welcome.reason;
  EXPECT_EQ(client.welcome.client, seat.client);
  EXPECT_THAT(client.welcome.hands, ElementsAre(kRightHand));
  const Tick next = client.welcome.tick + 1;
  playInLockstep(client, next, next + 20);
}

TEST(SessionServer, AnEmergencyStopIsAnybodysAndItsEndTheInstructors) {
  Running server({.name = "emergency", .wait_for = {"right"}});
  ScriptedClient trainee("emergency", LinkProfile::kLan);
  ScriptedClient teacher("emergency", LinkProfile::kLan);
  ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(teacher.join("teacher", Role::kInstructor, {}));
  trainee.emergencyStop(true);
  ASSERT_TRUE(trainee.hears([&] { return trainee.heard("emergency stop", "engaged by trainee"); }));

  trainee.emergencyStop(false);
  EXPECT_TRUE(trainee.hears([&] { return trainee.heard("refused", "may not clear"); }));
  trainee.command(CommandKind::kClearEmergencyStop);
  ASSERT_TRUE(trainee.hears([&] { return trainee.ack.id == 1; }));
  EXPECT_FALSE(trainee.ack.accepted);

  teacher.command(CommandKind::kClearEmergencyStop);
  ASSERT_TRUE(teacher.hears([&] { return teacher.ack.id == 1; }));
  EXPECT_TRUE(teacher.ack.accepted) << teacher.ack.reason;
  EXPECT_TRUE(teacher.hears([&] { return teacher.heard("emergency stop", "cleared by teacher"); }));
  teacher.command(CommandKind::kClearEmergencyStop);
  ASSERT_TRUE(teacher.hears([&] { return teacher.ack.id == 2; }));
  EXPECT_EQ(teacher.ack.reason, "there is no emergency stop");
}

TEST(SessionServer, AStopEndsASessionThatStillWaitsForPeople) {
  Running server({.name = "waiting", .wait_for = {"right"}});
  ScriptedClient teacher("waiting", LinkProfile::kLan);
  ASSERT_TRUE(teacher.join("teacher", Role::kInstructor, {}));
  teacher.command(CommandKind::kFulfilled);
  ASSERT_TRUE(teacher.hears([&] { return teacher.ack.id == 1; }));
  EXPECT_FALSE(teacher.ack.accepted) << "not accepted and then forgotten";
  EXPECT_THAT(teacher.ack.reason, HasSubstr("waits for people"));
  teacher.command(CommandKind::kStop);
  ASSERT_TRUE(teacher.hears([&] { return teacher.ack.id == 2; }));
  EXPECT_TRUE(teacher.ack.accepted) << teacher.ack.reason;
  EXPECT_EQ(server.end(false).run.phase, RunPhase::kStopped);
}

TEST(SessionServer, WaitsOnlyForWhomThereCanBe) {
  const auto server =
      SessionServer::open(test::smallSession(), {.domain = test::ownDomain(), .wait_for = {"third"}});
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().what, HasSubstr("'third'"));
}

TEST(SessionServer, ByDefaultWaitsForEveryHandOfTheTrainee) {
  const LoadedScene loaded = test::smallSession();
  EXPECT_THAT(traineeHands(*loaded.scenario), ElementsAre(kRightHand, test::kLeftHand));
}

}  // namespace
}  // namespace tenon
