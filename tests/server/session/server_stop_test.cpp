#include <cstdint>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/session/session_server.h"
#include "tests/server/session/running_server.h"
#include "tests/server/session/scripted_client.h"

namespace tenon::session {
namespace {

using test::runInLockstep;
using test::RunningServer;
using ::testing::HasSubstr;

TEST(SessionServer, WithoutAFileForTheEmergencyStopThatIsSaid) {
  RunningServer server({.name = "no file", .wait_for = {"right"}});
  test::ScriptedClient client("no file", wire::LinkProfile::kLan);
  ASSERT_TRUE(client.join("trainee", Role::kTrainee, {"right"}));
  EXPECT_TRUE(client.receivesUntil(
      [&] { return client.received("emergency stop", "will not stand after a restart"); }));
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
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.stops.raised() == 2; }));
  EXPECT_TRUE(
      trainee.receivesUntil([&] { return trainee.received("emergency stop", "engaged by trainee"); }));

  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.newest_raise.number % 1024 == 2; }));
  EXPECT_EQ(trainee.newest_raise.standing, 1U) << "of the client";
  const std::uint32_t newest = trainee.newest_raise.number;
  trainee.clearStop(newest);
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.ack.id == 1; }));
  EXPECT_FALSE(trainee.ack.accepted);
  admin.clearStop(newest);
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.ack.id == 1; }));
  EXPECT_THAT(admin.ack.reason, HasSubstr("an instructor is present"));

  instructor.clearStop(newest);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  EXPECT_TRUE(instructor.ack.accepted) << instructor.ack.reason;
  EXPECT_TRUE(trainee.receivesUntil([&] { return !trainee.stops.engaged(); }));
  EXPECT_EQ(trainee.stops.cleared().at("trainee").counter, 2U);
  instructor.clearStop(newest);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 2; }));
  EXPECT_EQ(instructor.ack.reason, "there is no emergency stop");

  trainee.emergencyStop();
  EXPECT_TRUE(trainee.receivesUntil([&] { return trainee.stops.engaged(); })) << "a new raise is not cleared";
}

TEST(SessionServer, ARaiseThatWhoClearsHasNotSeenStands) {
  RunningServer server({.name = "unseen", .wait_for = {"right"}});
  test::ScriptedClient trainee("unseen", wire::LinkProfile::kLan);
  test::ScriptedClient instructor("unseen", wire::LinkProfile::kLan);
  ASSERT_TRUE(trainee.join("trainee", Role::kTrainee, {"right"}));
  ASSERT_TRUE(instructor.join("instructor", Role::kInstructor, {}));
  trainee.emergencyStop();
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.newest_raise.standing == 1; }));
  EXPECT_EQ(instructor.newest_raise.reason, "a test");
  const std::uint32_t first = instructor.newest_raise.number;
  trainee.emergencyStop();
  ASSERT_TRUE(trainee.receivesUntil([&] { return trainee.newest_raise.number == first + 1; }));

  instructor.clearStop(first);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 1; }));
  EXPECT_EQ(instructor.ack.refusal, Refusal::kRaisedAgain);
  EXPECT_THAT(instructor.ack.reason,
              HasSubstr("a newer raise stands than those you were told of, by trainee"));
  EXPECT_TRUE(trainee.stops.cleared().empty());

  instructor.clearStop(first + 8);
  ASSERT_TRUE(instructor.receivesUntil([&] { return instructor.ack.id == 2; }));
  EXPECT_EQ(instructor.ack.refusal, Refusal::kRaisedAgain) << "of another life of the server";
  instructor.clearStop(first + 1);
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
  ASSERT_TRUE(admin.receivesUntil([&] { return admin.newest_raise.standing == 1; }));
  admin.clearStop(admin.newest_raise.number);
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
    EXPECT_TRUE(late.receivesUntil([&] {
      return late.stops.stands(raised) && late.stops.standing().size() == 2;
    })) << "the raise, and that of the server, which stands again for all who had heard of a clear";
    ASSERT_TRUE(late.receivesUntil([&] { return late.newest_raise.standing == 2; }));
    EXPECT_EQ(late.newest_raise.who, raised.who);
    late.clearStop(late.newest_raise.number);
    ASSERT_TRUE(late.receivesUntil([&] { return late.ack.id == 1; }));
    EXPECT_TRUE(late.ack.accepted) << late.ack.reason;
  }
  RunningServer server(options());
  test::ScriptedClient last("restart", wire::LinkProfile::kLan);
  ASSERT_TRUE(last.join("last", Role::kInstructor, {}));
  ASSERT_TRUE(last.receivesUntil([&] { return last.stops.cleared().size() == 2; }));
  EXPECT_FALSE(last.stops.engaged());
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace tenon::session
