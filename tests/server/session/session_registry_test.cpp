#include "server/session/session_registry.h"

#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/names.h"
#include "tests/server/session/small_session.h"

namespace tenon::session {
namespace {

using test::kInstructorHand;
using test::kLeftHand;
using test::kRightHand;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::uint32_t kEpoch = 77;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class SessionRegistryTest : public ::testing::Test {
 protected:
  Welcome join(const std::string& guid, Role role, std::vector<std::string> hands = {},
               const std::string& seat_key = {}, JoinProofs proofs = {.seat = true, .key = true}) {
    return registry_.join({.client_guid = guid,
                           .name = guid + "'s station",
                           .role = role,
                           .hands = std::move(hands),
                           .seat_key = seat_key.empty() ? "seat of " + guid : seat_key},
                          proofs, 5);
  }
  FixedVector<Change, kMaxChanges> changes() {
    FixedVector<Change, kMaxChanges> taken;
    registry_.takeChanges(taken);
    return taken;
  }
  CommandAck command(ClientId client, CommandKind kind, const std::string& text = {}, double value = 0.0,
                     HandId hand = {}) {
    return registry_.handleCommand({client, ++commands_, kind, hand, text, value});
  }
  static DeviceInput input(ClientId client, HandId hand) {
    DeviceInput all{.hand = hand, .client = client, .server_epoch = kEpoch, .active = true};
    all.sample = {.seq = 9, .X_WH = Pose(Vector3(0.1, 0.2, 0.3)), .buttons = 1};
    return all;
  }

  LoadedScene loaded_ = test::smallSession();
  SessionRegistry registry_{*loaded_.scenario, kEpoch, false};
  std::uint32_t commands_ = 0;
};

TEST_F(SessionRegistryTest, AcceptsATraineeAndAttachesItsHands) {
  const Welcome welcome = join("a", Role::kTrainee, {"left", "right"});
  ASSERT_TRUE(welcome.accepted) << welcome.reason;
  EXPECT_EQ(welcome.client, ClientId{1});
  EXPECT_THAT(welcome.hands, ElementsAre(test::kLeftHand, test::kRightHand)) << "in the requested order";
  EXPECT_EQ(welcome.client_guid, "a");
  EXPECT_EQ(welcome.server_epoch, kEpoch);
  EXPECT_EQ(welcome.tick, 5U);
  EXPECT_EQ(registry_.controllerOf(test::kRightHand), welcome.client);
  EXPECT_TRUE(registry_.isRolePresent(Role::kTrainee));
  EXPECT_FALSE(registry_.controllerOf(test::kInstructorHand).valid());

  const auto taken = changes();
  ASSERT_EQ(taken.size(), 2U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kAttach);
  EXPECT_EQ(taken[0].hand, test::kLeftHand);
  EXPECT_EQ(taken[1].hand, test::kRightHand);
  EXPECT_TRUE(changes().empty()) << "each change is taken once";
}

TEST_F(SessionRegistryTest, RefusesWithAReason) {
  Join old{.client_guid = "old", .role = Role::kObserver, .protocol_version = kProtocolVersion + 1};
  EXPECT_THAT(registry_.join(old, {}, 0).reason, HasSubstr("protocol version"));
  EXPECT_THAT(join("b", Role::kTrainee, {"instructor"}).reason, HasSubstr("belongs to the instructor"));
  EXPECT_THAT(join("c", Role::kObserver, {"right"}).reason, HasSubstr("belongs to the trainee"));
  EXPECT_THAT(join("d", static_cast<Role>(99)).reason, HasSubstr("role"));
  EXPECT_THAT(join("", Role::kObserver).reason, HasSubstr("client_guid"));
  ASSERT_TRUE(join("e", Role::kTrainee, {"right"}).accepted);
  const Welcome late = join("f", Role::kTrainee, {"left", "right"});
  EXPECT_FALSE(late.accepted);
  EXPECT_THAT(late.reason, HasSubstr("'right' is already moved"));
  EXPECT_FALSE(late.client.valid());
  EXPECT_FALSE(registry_.controllerOf(test::kLeftHand).valid()) << "a refused client gets none of the hands";
  EXPECT_EQ(registry_.clients().size(), 1U);
}

TEST_F(SessionRegistryTest, ACouplingIsAsStiffAsItsDeviceAllowsUnlessTheScenarioWantsLess) {
  const auto coupling = [](const HandStiffness& asked, const HandStiffness& offered) {
    game_control::ScenarioFile scenario = *test::smallSession().scenario;
    scenario.hands[kRightHand.value].stiffness = asked.translational;
    scenario.hands[kRightHand.value].rotational_stiffness = asked.rotational;
    SessionRegistry registry(scenario, kEpoch, false);
    Join join{.client_guid = "a", .role = Role::kTrainee, .hands = {"head", "right"}};
    join.stiffness = {{7.0, 7.0}, offered};
    EXPECT_TRUE(registry.join(join, {.seat = true, .key = true}, 5).accepted);
    FixedVector<Change, kMaxChanges> taken;
    registry.takeChanges(taken);
    return std::pair(taken[0].stiffness.translational, taken[0].stiffness.rotational);
  };
  EXPECT_EQ(coupling({}, {5000.0, 100.0}), std::pair(5000.0, 100.0));
  EXPECT_EQ(coupling({1000.0, 20.0}, {5000.0, 100.0}), std::pair(1000.0, 20.0));
  EXPECT_EQ(coupling({3000.0, 20.0}, {2000.0, 0.0}), std::pair(2000.0, 20.0)) << "a device without torque";
  EXPECT_EQ(coupling({}, {}), std::pair(0.0, 0.0)) << "not stated: the simulation's own";
}

TEST_F(SessionRegistryTest, AStiffnessThatNoDeviceHasIsRefused) {
  for (const double bad : {-1.0, 5e-324, 0.5, 2e4, kNan, std::numeric_limits<double>::infinity()}) {
    Join join{.client_guid = "a", .role = Role::kTrainee, .hands = {"right"}};
    join.stiffness = {{bad, 1.0}};
    EXPECT_THAT(registry_.join(join, {.seat = true, .key = true}, 5).reason, HasSubstr("stiffness")) << bad;
  }
  EXPECT_TRUE(changes().empty());
}

TEST_F(SessionRegistryTest, AHandTheScenarioDoesNotHaveHasAnInvalidIdInItsPlace) {
  const Welcome welcome = join("a", Role::kTrainee, {"head", "right", "arm"});
  ASSERT_TRUE(welcome.accepted) << welcome.reason;
  EXPECT_THAT(welcome.hands, ElementsAre(HandId{}, test::kRightHand, HandId{}));
  EXPECT_EQ(changes().size(), 1U);
}

TEST_F(SessionRegistryTest, ARepeatedJoinGetsTheSameAnswer) {
  const Welcome first = join("a", Role::kTrainee, {"right"});
  const Welcome again = join("a", Role::kTrainee, {"right"});
  EXPECT_TRUE(again.accepted);
  EXPECT_EQ(again.client, first.client);
  EXPECT_EQ(again.hands, first.hands);
  EXPECT_EQ(registry_.clients().size(), 1U);
  EXPECT_EQ(changes().size(), 1U) << "the hand is attached once";
}

TEST_F(SessionRegistryTest, TheKeyOfASeatRejoinsAsTheSameClient) {
  const Welcome first = join("a", Role::kTrainee, {"right"});
  const std::string key = "seat of a";
  (void)join("b", Role::kObserver);
  registry_.leave(first.client);
  EXPECT_EQ(join("c", Role::kTrainee, {"right"}, key).client, first.client);
  EXPECT_EQ(registry_.guidOf(first.client), "c");

  // a station that was restarted before its former process was noticed to be gone
  (void)changes();
  const Welcome again = join("d", Role::kTrainee, {"right"}, key);
  EXPECT_TRUE(again.accepted) << again.reason;
  EXPECT_EQ(again.client, first.client);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 2U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kDetach);
  EXPECT_EQ(taken[1].kind, ChangeKind::kAttach);
  EXPECT_EQ(registry_.clients().size(), 2U);

  EXPECT_EQ(join("e", Role::kObserver, {}, "no such seat").client, ClientId{3});
}

TEST_F(SessionRegistryTest, NobodyIsEvictedByARequestThatIsRefused) {
  const Welcome first = join("a", Role::kTrainee, {"right"});
  (void)changes();
  EXPECT_TRUE(registry_.mustProve({.role = Role::kObserver, .seat_key = "seat of a"}));
  EXPECT_FALSE(registry_.mustProve({.role = Role::kObserver, .seat_key = "a new one"}));
  const std::string key = "seat of a";
  EXPECT_THAT(join("b", Role::kTrainee, {"right"}, key, {.seat = false}).reason,
              HasSubstr("another program's"));
  EXPECT_THAT(join("c", Role::kTrainee, {"instructor"}, key).reason, HasSubstr("belongs to the instructor"));
  EXPECT_THAT(join("d", Role::kInstructor, {}, key, {.seat = true, .key = false}).reason,
              HasSubstr("needs the key"));
  EXPECT_TRUE(registry_.findClient(first.client)->alive);
  EXPECT_EQ(registry_.controllerOf(test::kRightHand), first.client);
  EXPECT_TRUE(changes().empty());
}

TEST_F(SessionRegistryTest, BeyondLoopbackTheKeyIsNeededByAll) {
  registry_.requireKey(true);
  for (const Role role : {Role::kTrainee, Role::kObserver, Role::kRecorder}) {
    EXPECT_TRUE(registry_.mustProve({.role = role}));
    EXPECT_THAT(join("a", role, {}, {}, {.seat = true}).reason, HasSubstr("needs the key of this session"));
    const Welcome welcome = join(std::string(roleName(role)), role, {}, {}, {.seat = true, .key = true});
    EXPECT_TRUE(welcome.accepted) << welcome.reason;
  }
}

TEST_F(SessionRegistryTest, TheKeyIsNeededByInstructorsAndAdminsAlone) {
  for (const Role role : {Role::kAdmin, Role::kInstructor}) {
    EXPECT_TRUE(registry_.mustProve({.role = role}));
    EXPECT_THAT(join("a", role, {}, {}, {.seat = true}).reason, HasSubstr("needs the key of this session"));
  }
  for (const Role role : {Role::kTrainee, Role::kObserver, Role::kRecorder}) {
    EXPECT_FALSE(registry_.mustProve({.role = role}));
    EXPECT_TRUE(join("b" + std::to_string(static_cast<int>(role)), role, {}, {}, {}).accepted);
  }
}

TEST_F(SessionRegistryTest, SeatsAreBounded) {
  for (const RoleRights& row : kRoles) {
    const std::string name = std::to_string(static_cast<int>(row.role));
    for (std::size_t i = 0; i < row.seats; ++i)
      ASSERT_TRUE(join(name + "/" + std::to_string(i), row.role).accepted) << name << " " << i;
    EXPECT_THAT(join(name + "/more", row.role).reason, HasSubstr("seats of the role")) << name;
    EXPECT_TRUE(join(name + "/again", row.role, {}, "seat of " + name + "/0").accepted)
        << "who has a seat may come back to it";
  }
  // those who come and go for days: the memory of who left is bounded too
  const ClientId first{1};
  registry_.leave(ClientId{17});  // a trainee: the seats of admins and instructors were given first
  for (int i = 0; i < 3000; ++i) {
    registry_.leave(join("visitor " + std::to_string(i), Role::kTrainee).client);
    registry_.leave(first);
    ASSERT_TRUE(join("admin " + std::to_string(i), Role::kAdmin, {}, "seat of 0/0").accepted);
  }
  EXPECT_LE(registry_.clients().size(), 1024U);
  EXPECT_EQ(registry_.findClient(first)->name, "admin 2999's station");
}

TEST_F(SessionRegistryTest, AClearedEmergencyStopLeavesTheRunPaused) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("b", Role::kInstructor).client;
  EXPECT_THAT(command(instructor, CommandKind::kClearEmergencyStop).reason, HasSubstr("no emergency stop"));
  registry_.engageEmergencyStop();
  EXPECT_TRUE(command(instructor, CommandKind::kClearEmergencyStop).accepted);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 3U);
  EXPECT_EQ(taken[1].kind, ChangeKind::kPause) << "before the stop ends";
  EXPECT_EQ(taken[2].kind, ChangeKind::kSetEmergencyStop);
  EXPECT_EQ(taken[2].value, 0.0);
  EXPECT_TRUE(command(instructor, CommandKind::kResume).accepted);
}

TEST_F(SessionRegistryTest, AClientThatLeavesFreesItsHands) {
  const Welcome welcome = join("a", Role::kTrainee, {"right", "left"});
  (void)changes();
  registry_.leave(welcome.client);
  registry_.leave(welcome.client);
  registry_.leave(ClientId{99});
  registry_.leave(ClientId{});
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 2U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kDetach);
  EXPECT_FALSE(registry_.findClient(welcome.client)->alive);
  EXPECT_FALSE(registry_.isRolePresent(Role::kTrainee));
  EXPECT_FALSE(registry_.validateDeviceInput(input(welcome.client, test::kRightHand)));
  EXPECT_FALSE(command(welcome.client, CommandKind::kFulfilled).accepted);
  EXPECT_TRUE(join("b", Role::kTrainee, {"right"}).accepted);
}

TEST_F(SessionRegistryTest, AcceptsDeviceInputOfAControlledHand) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto reading = registry_.validateDeviceInput(input(client, test::kRightHand));
  ASSERT_TRUE(reading) << reading.error().what;
  EXPECT_EQ(reading->hand, test::kRightHand);
  EXPECT_EQ(reading->seq, 9U);
  EXPECT_TRUE(reading->active);
  EXPECT_EQ(reading->buttons, 1U);
  EXPECT_EQ(reading->X_WH.translation(), Vector3(0.1, 0.2, 0.3));
}

TEST_F(SessionRegistryTest, ARepeatedCommandGetsTheFormerAckAndIsNotAppliedAgain) {
  const Welcome welcome = join("b", Role::kInstructor);
  const ClientId instructor = welcome.client;
  registry_.updatePhase(RunPhase::kRunning, false);
  const Command pause{instructor, 7, CommandKind::kPause};
  EXPECT_EQ(registry_.previousAck(pause), nullptr);
  EXPECT_TRUE(registry_.handleCommand(pause).accepted);
  registry_.updatePhase(RunPhase::kPaused, false);
  ASSERT_NE(registry_.previousAck(pause), nullptr);
  EXPECT_TRUE(registry_.previousAck(pause)->accepted) << "although a new command would be refused now";
  EXPECT_EQ(registry_.previousAck({instructor, 8, CommandKind::kPause}), nullptr);
  EXPECT_EQ(registry_.previousAck({ClientId{9}, 7, CommandKind::kPause}), nullptr);
  registry_.leave(instructor);
  ASSERT_EQ(join("c", Role::kInstructor, {}, "seat of b").client, instructor);
  EXPECT_EQ(registry_.previousAck(pause), nullptr) << "a rejoined client numbers its commands anew";
}

TEST_F(SessionRegistryTest, CommandsBetweenTwoTicksAreJudgedByThePendingPhase) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning, false);
  EXPECT_TRUE(command(instructor, CommandKind::kPause).accepted);
  registry_.updatePhase(RunPhase::kRunning, false);  // of a tick that was computed before
  EXPECT_THAT(command(instructor, CommandKind::kPause).reason, HasSubstr("paused already"));
  EXPECT_TRUE(command(instructor, CommandKind::kResume).accepted);
  EXPECT_THAT(command(instructor, CommandKind::kResume).reason, HasSubstr("not paused"));
  registry_.updatePhase(RunPhase::kPaused, false);
  registry_.updatePhase(RunPhase::kRunning, false);
  EXPECT_TRUE(command(instructor, CommandKind::kPause).accepted);
  registry_.updatePhase(RunPhase::kStopped, false);
  EXPECT_THAT(command(instructor, CommandKind::kResume).reason, HasSubstr("over"));
}

TEST_F(SessionRegistryTest, ARoundTripIsToldInStepsAndNotForEachThatIsALittleDifferent) {
  const Welcome welcome = join("a", Role::kTrainee, {"right"});
  (void)changes();
  EXPECT_FALSE(registry_.setLimits(welcome.client, {}, 0.0024)) << "that of a local network";
  EXPECT_FALSE(registry_.setLimits(welcome.client, {}, std::nan("")));
  EXPECT_TRUE(registry_.setLimits(welcome.client, {}, 0.0521));
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kSetLimits);
  EXPECT_NEAR(taken[0].value, 0.0525, 1e-12) << "never a shorter one than there is";
  EXPECT_FALSE(registry_.setLimits(welcome.client, {}, 0.0479));
  EXPECT_TRUE(registry_.setLimits(welcome.client, {}, 0.0526)) << "a longer one counts at once";
  EXPECT_NEAR(registry_.roundTripOf(test::kRightHand), 0.055, 1e-12);
  EXPECT_TRUE(registry_.setLimits(welcome.client, {}, 0.0499));
  registry_.leave(welcome.client);
  EXPECT_EQ(registry_.roundTripOf(test::kRightHand), 0.0);
}

TEST_F(SessionRegistryTest, AStationChoosesTheLimitsOfItsOwnHandsWithinTheBoundsAndUntilItLeaves) {
  const Welcome welcome = join("a", Role::kTrainee, {"right"});
  (void)changes();
  EXPECT_FALSE(registry_.setLimits(welcome.client, {})) << "they are so already";
  EXPECT_TRUE(registry_.setLimits(welcome.client, {.freeze_ticks = 80, .park_ticks = 1300}));
  EXPECT_FALSE(registry_.setLimits(welcome.client, {.freeze_ticks = 80, .park_ticks = 1300}));
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kSetLimits);
  EXPECT_EQ(taken[0].hand, test::kRightHand);
  EXPECT_EQ(taken[0].index, 80U);
  EXPECT_EQ(taken[0].lifetime_ticks, 1300U);
  EXPECT_EQ(registry_.limitsOf(test::kLeftHand), HandLimits{});
  EXPECT_TRUE(registry_.setLimits(welcome.client, {.freeze_ticks = 1'000'000, .park_ticks = 0}));
  EXPECT_EQ(registry_.limitsOf(test::kRightHand), (HandLimits{kMostFreezeTicks, kParkTicks}));
  EXPECT_FALSE(registry_.setLimits(ClientId{9}, {.freeze_ticks = 80, .park_ticks = 1300}));
  registry_.leave(welcome.client);
  EXPECT_EQ(registry_.limitsOf(test::kRightHand), HandLimits{});
}

TEST_F(SessionRegistryTest, RefusesDeviceInputForHandsOfOthers) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const ClientId instructor = join("b", Role::kInstructor, {"instructor"}).client;
  DeviceInput stale = input(client, test::kRightHand);
  stale.server_epoch = kEpoch - 1;
  EXPECT_THAT(registry_.validateDeviceInput(stale).error().what, HasSubstr("earlier run"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, test::kInstructorHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(instructor, test::kRightHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, test::kLeftHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, HandId{17})).error().what,
              HasSubstr("does not have"));
  EXPECT_FALSE(registry_.validateDeviceInput(input(client, HandId{})));
  EXPECT_FALSE(registry_.validateDeviceInput(input(ClientId{}, test::kLeftHand)))
      << "an invalid id does not control a free hand";
}

TEST_F(SessionRegistryTest, RefusesImplausiblePosesAndVelocities) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto refuses = [&](auto&& corrupt) {
    DeviceInput bad = input(client, test::kRightHand);
    corrupt(bad.sample);
    return !registry_.validateDeviceInput(bad);
  };
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(kNan, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(1e9, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3::Zero(), Quaternion(0, 0, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3::Zero(), Quaternion(1, 1, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.linear = Vector3(0, kNan, 0); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.linear = Vector3(0, 1e300, 0); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.angular = Vector3(0, 0, 1e4); }));
  EXPECT_FALSE(refuses([](DeviceSample& s) { s.V_WH.angular = Vector3(0, 0, 10); }));
}

TEST_F(SessionRegistryTest, CommandsArePermittedByRole) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId trainee = join("a", Role::kTrainee, {"right"}).client;
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId observer = join("c", Role::kObserver).client;
  const ClientId recorder = join("d", Role::kRecorder).client;
  (void)changes();
  EXPECT_EQ(command(ClientId{}, CommandKind::kFulfilled).reason, "join first");
  EXPECT_THAT(command(observer, CommandKind::kFulfilled).reason, HasSubstr("not permitted for the observer"));
  EXPECT_THAT(command(recorder, CommandKind::kStop).reason, HasSubstr("not permitted for the recorder"));
  for (const CommandKind kind : {CommandKind::kPause, CommandKind::kResume, CommandKind::kReset,
                                 CommandKind::kSkipStep, CommandKind::kStop, CommandKind::kSetCollision}) {
    EXPECT_THAT(command(trainee, kind, "part bay").reason, HasSubstr("ask the instructor"));
    registry_.updatePhase(kind == CommandKind::kResume ? RunPhase::kPaused : RunPhase::kRunning, false);
    EXPECT_TRUE(command(instructor, kind, "part bay").accepted);
  }
  EXPECT_EQ(changes().size(), 6U);
  EXPECT_TRUE(command(trainee, CommandKind::kFulfilled).accepted);
  EXPECT_THAT(command(instructor, static_cast<CommandKind>(99)).reason, HasSubstr("unknown command"));

  const CommandAck ack = command(instructor, CommandKind::kPause);
  EXPECT_EQ(ack.client, instructor);
  EXPECT_EQ(ack.id, commands_) << "the ack carries the id of its command";
}

TEST_F(SessionRegistryTest, StepsAreNamedByNameOrNumber) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("b", Role::kInstructor).client;
  (void)changes();
  for (const std::string text : {"2", "mount"})
    EXPECT_TRUE(command(instructor, CommandKind::kGoToStep, text).accepted) << text;
  for (const std::string text : {"0", "3", "mounting", "", "1 ", "-1"})
    EXPECT_THAT(command(instructor, CommandKind::kGoToStep, text).reason, HasSubstr("no step")) << text;
  for (const Change& change : changes()) EXPECT_EQ(change.game.signal, 1U);
}

TEST_F(SessionRegistryTest, AnObjectIsHandedToAHandThatSomebodyMoves) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("b", Role::kInstructor).client;
  const auto reason = [&](const std::string& text) {
    return command(instructor, CommandKind::kHandOver, text).reason;
  };
  EXPECT_THAT(reason("part right"), HasSubstr("nobody moves hand 'right'"));
  (void)join("a", Role::kTrainee, {"right"});
  EXPECT_EQ(reason("part right"), "");
  EXPECT_THAT(reason("part"), HasSubstr("does not name a hand"));
  EXPECT_THAT(reason("party right"), HasSubstr("does not name an object"));
  EXPECT_THAT(reason("bay right"), HasSubstr("nothing that a hand takes"));
  EXPECT_THAT(reason("pointer right"), HasSubstr("nothing that a hand takes"));
}

TEST_F(SessionRegistryTest, ATrackedHandIsHandedNothing) {
  game_control::ScenarioFile scenario = *loaded_.scenario;
  scenario.hands[kLeftHand.value].kind = simulation::HandKind::kTracked;
  SessionRegistry registry(scenario, kEpoch, false);
  const ClientId instructor = registry
                                  .join({.client_guid = "b", .role = Role::kInstructor, .seat_key = "seat"},
                                        {.seat = true, .key = true}, 5)
                                  .client;
  registry.updatePhase(RunPhase::kRunning, false);
  EXPECT_THAT(registry.handleCommand({instructor, 1, CommandKind::kHandOver, {}, "part left"}).reason,
              HasSubstr("hand 'left' is tracked"));
}

TEST_F(SessionRegistryTest, WhoIsRemovedLeavesAndDoesNotGetTheSeatAgain) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId trainee = join("a", Role::kTrainee, {"right"}).client;
  (void)changes();
  EXPECT_EQ(command(trainee, CommandKind::kKick, "b").refusal, Refusal::kNotPermitted);
  EXPECT_EQ(command(instructor, CommandKind::kKick, "nobody").refusal, Refusal::kUnknownName);
  EXPECT_THAT(command(instructor, CommandKind::kKick, std::to_string(instructor.value)).reason,
              HasSubstr("yourself"));
  EXPECT_TRUE(registry_.takeKicked().empty());

  EXPECT_TRUE(command(instructor, CommandKind::kKick, std::to_string(trainee.value)).accepted);
  EXPECT_THAT(registry_.takeKicked(), ElementsAre(trainee));
  EXPECT_TRUE(registry_.takeKicked().empty()) << "once";
  registry_.leave(trainee);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kDetach);
  EXPECT_THAT(join("a", Role::kTrainee, {"right"}).reason, HasSubstr("you were removed"));
  EXPECT_TRUE(join("z", Role::kTrainee, {"right"}).accepted) << "the hand is free for others";
  EXPECT_TRUE(command(instructor, CommandKind::kKick, std::to_string(trainee.value)).accepted) << "still so";
}

TEST_F(SessionRegistryTest, WhoIsAwayIsRemovedTooAndDoesNotComeBack) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId away = join("a", Role::kObserver).client;
  registry_.leave(away);
  EXPECT_TRUE(command(instructor, CommandKind::kKick, std::to_string(away.value)).accepted);
  EXPECT_THAT(join("a", Role::kObserver).reason, HasSubstr("you were removed"));
}

TEST_F(SessionRegistryTest, AnAdminIsRemovedByAnAdminAlone) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId admin = join("a", Role::kAdmin).client;
  const ClientId other = join("c", Role::kAdmin).client;
  EXPECT_EQ(command(instructor, CommandKind::kKick, std::to_string(admin.value)).refusal,
            Refusal::kNotPermitted);
  EXPECT_TRUE(command(other, CommandKind::kKick, std::to_string(admin.value)).accepted);
}

TEST_F(SessionRegistryTest, ARefusalHasAKindForDisplays) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId trainee = join("a", Role::kTrainee).client;
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kWaiting);
  registry_.updatePhase(RunPhase::kRunning, false);
  EXPECT_EQ(command(ClientId{}, CommandKind::kSkipStep).refusal, Refusal::kNotJoined);
  EXPECT_EQ(command(trainee, CommandKind::kSkipStep).refusal, Refusal::kNotPermitted);
  EXPECT_EQ(command(instructor, CommandKind::kResume).refusal, Refusal::kAlready);
  EXPECT_EQ(command(instructor, CommandKind::kGoToStep, "nowhere").refusal, Refusal::kUnknownName);
  EXPECT_EQ(command(instructor, CommandKind::kHandOver, "part right").refusal, Refusal::kNobodyThere);
  EXPECT_EQ(command(instructor, CommandKind::kHandOver, "bay right").refusal, Refusal::kNotHoldable);
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kNone);
  registry_.updatePhase(RunPhase::kSucceeded, false);
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kOver);
}

TEST_F(SessionRegistryTest, FrozenForcesAreAChange) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  (void)changes();
  EXPECT_TRUE(command(instructor, CommandKind::kFreezeForces, {}, 1.0).accepted) << "in any phase";
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kFreezeForces);
  EXPECT_EQ(taken[0].value, 1.0);
}

TEST_F(SessionRegistryTest, ANoteChangesNothing) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId trainee = join("a", Role::kTrainee, {"right"}).client;
  const ClientId observer = join("c", Role::kObserver).client;
  (void)changes();
  EXPECT_TRUE(command(trainee, CommandKind::kNote, "slipped twice").accepted);
  EXPECT_FALSE(command(trainee, CommandKind::kNote, "").accepted);
  EXPECT_FALSE(command(observer, CommandKind::kNote, "hello").accepted);
  EXPECT_TRUE(changes().empty());
}

// it would be in the next checkpoint, which no reader takes
TEST_F(SessionRegistryTest, ACommandWithAValueThatIsNotFiniteIsRefused) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("a", Role::kInstructor).client;
  (void)changes();
  const CommandAck ack = registry_.handleCommand(
      {.client = instructor, .id = 1, .kind = CommandKind::kSkipStep, .value = std::nan("")});
  EXPECT_FALSE(ack.accepted);
  EXPECT_THAT(ack.reason, HasSubstr("not a finite number"));
  EXPECT_TRUE(changes().empty());
}

TEST_F(SessionRegistryTest, NamesInCommandsAreResolvedToIndices) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId instructor = join("a", Role::kInstructor).client;
  EXPECT_THAT(command(instructor, CommandKind::kSignal, "whistle").reason, HasSubstr("'whistle'"));
  EXPECT_TRUE(command(instructor, CommandKind::kSignal, "bell").accepted);
  for (const std::string wrong : {"", "part", "part nothing", "part part", " ", "part  bay"})
    EXPECT_FALSE(command(instructor, CommandKind::kSetCollision, wrong).accepted) << wrong;
  EXPECT_TRUE(command(instructor, CommandKind::kSetCollision, "bay part", 0.0).accepted);

  const auto taken = changes();
  ASSERT_EQ(taken.size(), 2U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kGameCommand);
  EXPECT_EQ(taken[0].game.kind, CommandKind::kSignal);
  EXPECT_EQ(loaded_.scenario->signals[taken[0].game.signal], "bell");
  EXPECT_EQ(taken[1].kind, ChangeKind::kEnablePair);
  const game_control::ScenarioPair& pair = loaded_.scenario->pairs[taken[1].index];
  EXPECT_EQ(pair.a.value + pair.b.value, 1U) << "bay is object 0, part object 1";
  EXPECT_EQ(taken[1].value, 0.0);
}

TEST_F(SessionRegistryTest, AClientReleasesAndSwapsOnlyHandsItControls) {
  registry_.updatePhase(RunPhase::kRunning, false);
  const ClientId one = join("a", Role::kTrainee, {"right"}).client;
  const ClientId other = join("b", Role::kTrainee, {"left"}).client;
  const ClientId instructor = join("c", Role::kInstructor, {"instructor"}).client;
  EXPECT_TRUE(command(one, CommandKind::kRelease, {}, 0.0, test::kRightHand).accepted);
  EXPECT_FALSE(command(other, CommandKind::kRelease, {}, 0.0, test::kRightHand).accepted);
  EXPECT_TRUE(command(instructor, CommandKind::kRelease, {}, 0.0, test::kRightHand).accepted);
  EXPECT_FALSE(command(instructor, CommandKind::kRelease, {}, 0.0, HandId{17}).accepted);
  EXPECT_FALSE(command(one, CommandKind::kSwapHands, {}, kNan).accepted)
      << "the other hand is controlled by another client";
  EXPECT_TRUE(command(instructor, CommandKind::kSwapHands).accepted);
  registry_.leave(other);
  registry_.leave(one);
  const ClientId both = join("d", Role::kTrainee, {"right", "left"}).client;
  EXPECT_TRUE(command(both, CommandKind::kSwapHands).accepted);
}

TEST_F(SessionRegistryTest, OfExternalForcesThoseOfStrangersOnNothingAndNotFiniteAreRefused) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId observer = join("b", Role::kObserver).client;
  const ForceContribution push{.source = 4,
                               .client = trainee,
                               .object = ObjectId{1},
                               .F_Oo_W = {Vector3(0, 0, 5), Vector3::Zero()},
                               .lifetime_ticks = 1'000'000};
  const auto change = registry_.validateForceContribution(push);
  ASSERT_TRUE(change) << change.error().what;
  EXPECT_EQ(change->kind, ChangeKind::kContributeForce);
  EXPECT_EQ(change->object, ObjectId{1});
  EXPECT_EQ(change->index, 4U);
  EXPECT_EQ(change->lifetime_ticks, 1'000'000U) << "limits are those of the ForceBuffer";
  EXPECT_EQ(change->F_Oo_W.force, Vector3(0, 0, 5));

  const auto refuses = [&](auto&& corrupt) {
    ForceContribution bad = push;
    corrupt(bad);
    return !registry_.validateForceContribution(bad);
  };
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = observer; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = ClientId{9}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = ObjectId{99}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = {}; }));
  EXPECT_FALSE(refuses([&](ForceContribution& f) { f.F_Oo_W.force = Vector3(0, 0, 201); }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.force = Vector3(0, kNan, 0); }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.torque = Vector3(0, kNan, 0); }));
}

TEST_F(SessionRegistryTest, OnlyWithInstructorRightsObjectsArePlaced) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ExternalPose pose{.object = ObjectId{1}, .client = instructor, .X_WO = Pose(Vector3(1, 0, 0))};
  ASSERT_TRUE(registry_.validateExternalPose(pose));
  EXPECT_EQ(registry_.validateExternalPose(pose)->kind, ChangeKind::kPlaceObject);
  ExternalPose bad = pose;
  bad.client = trainee;
  EXPECT_FALSE(registry_.validateExternalPose(bad));
  bad = pose;
  bad.object = ObjectId{99};
  EXPECT_FALSE(registry_.validateExternalPose(bad));
  bad = pose;
  bad.X_WO = Pose(Vector3(0, 0, kNan));
  EXPECT_FALSE(registry_.validateExternalPose(bad));
}

TEST_F(SessionRegistryTest, ChangesBeyondTheCapacityOfATickWaitForTheNext) {
  const ClientId instructor = join("a", Role::kInstructor).client;
  for (int i = 0; i < 40; ++i) (void)command(instructor, CommandKind::kSetCollision, "bay part", i);
  EXPECT_EQ(changes().size(), kMaxChanges);
  EXPECT_EQ(changes().size(), kMaxChanges);
  const auto rest = changes();
  ASSERT_EQ(rest.size(), 40 - 2 * kMaxChanges);
  EXPECT_EQ(rest[0].kind, ChangeKind::kEnablePair);
  EXPECT_EQ(rest[0].value, 32.0) << "in order";
}

TEST_F(SessionRegistryTest, ASeatBelongsToTheParticipantThatJoined) {
  const wire::Origin owner{{1, 2, 3}};
  const wire::Origin intruder{{9, 9, 9}};
  const Join join{
      .client_guid = "a", .name = "Ada", .role = Role::kTrainee, .hands = {"right"}, .seat_key = "a"};
  const Welcome welcome = registry_.join(join, {}, 0, owner);
  EXPECT_TRUE(registry_.ownsSeat(welcome.client, owner));
  EXPECT_FALSE(registry_.ownsSeat(welcome.client, intruder));
  (void)registry_.join(join, {}, 0, intruder);
  EXPECT_TRUE(registry_.ownsSeat(welcome.client, owner))
      << "a repeated join from elsewhere does not move the seat";
  EXPECT_FALSE(registry_.ownsSeat(ClientId{9}, owner));
}

TEST_F(SessionRegistryTest, CommandsThatCannotTakeEffectNowAreRefusedWithAReason) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  const auto answer = [&](CommandKind kind) { return command(instructor, kind).reason; };
  (void)changes();
  for (const CommandKind kind : {CommandKind::kFulfilled, CommandKind::kPause, CommandKind::kResume,
                                 CommandKind::kReset, CommandKind::kSkipStep, CommandKind::kSwapHands})
    EXPECT_THAT(answer(kind), HasSubstr("waits for people"));
  EXPECT_THAT(command(instructor, CommandKind::kSignal, "bell").reason, HasSubstr("waits for people"));
  EXPECT_TRUE(changes().empty());

  registry_.updatePhase(RunPhase::kRunning, false);
  EXPECT_THAT(answer(CommandKind::kResume), HasSubstr("not paused"));
  EXPECT_THAT(answer(CommandKind::kPause), IsEmpty());
  registry_.updatePhase(RunPhase::kPaused, false);
  EXPECT_THAT(answer(CommandKind::kPause), HasSubstr("paused already"));
  EXPECT_THAT(answer(CommandKind::kResume), IsEmpty());
  registry_.updatePhase(RunPhase::kSucceeded, false);
  EXPECT_THAT(answer(CommandKind::kReset), HasSubstr("over"));
}

TEST_F(SessionRegistryTest, DeferredCommandsAreLimitedToTheCapacityOfATick) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kPaused, false);
  for (std::size_t i = 0; i < kMaxChanges; ++i)
    EXPECT_TRUE(command(instructor, CommandKind::kFulfilled).accepted) << i;
  EXPECT_THAT(command(instructor, CommandKind::kFulfilled).reason, HasSubstr("wait already"));
  EXPECT_TRUE(command(instructor, CommandKind::kResume).accepted);
  registry_.updatePhase(RunPhase::kRunning, false);
  EXPECT_TRUE(command(instructor, CommandKind::kFulfilled).accepted);
}

TEST_F(SessionRegistryTest, AHandIsReleasedByItsName) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  (void)changes();
  EXPECT_TRUE(command(instructor, CommandKind::kRelease, "left").accepted);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].hand, test::kLeftHand);
  EXPECT_THAT(command(instructor, CommandKind::kRelease, "third").reason, HasSubstr("no hand 'third'"));
}

}  // namespace
}  // namespace tenon::session
