#include "idl/types/names.h"
#include "tests/server/session/registry_session.h"

namespace tenon::session {
namespace {

using test::kRightHand;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SessionRegistryTest : public RegistrySession {};

TEST_F(SessionRegistryTest, AcceptsATraineeAndAttachesItsHands) {
  const Welcome welcome = join("a", Role::kTrainee, {"left", "right"});
  ASSERT_TRUE(welcome.accepted) << welcome.reason;
  EXPECT_EQ(welcome.client, ClientId{1});
  EXPECT_THAT(welcome.hands, ElementsAre(test::kLeftHand, test::kRightHand)) << "in the requested order";
  EXPECT_THAT(welcome.objects, ElementsAre(loaded_.scenario->hands[test::kLeftHand.value].object,
                                           loaded_.scenario->hands[test::kRightHand.value].object));
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

TEST_F(SessionRegistryTest, ForWhatInputsAreKeptBackTheirRoundTripIsLonger) {
  const Welcome welcome = join("a", Role::kTrainee, {"right"});
  const auto ticks = [](std::uint32_t kept) { return [kept](HandId) { return kept; }; };
  EXPECT_FALSE(registry_.setLimits(welcome.client, {}, 0.0004, ticks(2)))
      << "that of a local network with losses";
  EXPECT_TRUE(registry_.setLimits(welcome.client, {}, 0.0041, ticks(2)));
  EXPECT_NEAR(registry_.roundTripOf(test::kRightHand), 0.0075, 1e-12);
  EXPECT_TRUE(registry_.setLimits(welcome.client, {}, 0.0221, ticks(14)));
  EXPECT_NEAR(registry_.roundTripOf(test::kRightHand), 0.0375, 1e-12);
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

TEST_F(SessionRegistryTest, WhoIsRemovedLeavesAndDoesNotGetTheSeatAgain) {
  registry_.updatePhase(RunPhase::kRunning);
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
  const CommandAck again = command(instructor, CommandKind::kKick, std::to_string(trainee.value));
  EXPECT_EQ(again.refusal, Refusal::kAlready);
  EXPECT_THAT(again.reason, HasSubstr("a's station has been removed already"));
}

TEST_F(SessionRegistryTest, WhoIsAwayIsRemovedTooAndDoesNotComeBack) {
  registry_.updatePhase(RunPhase::kRunning);
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

}  // namespace
}  // namespace tenon::session
