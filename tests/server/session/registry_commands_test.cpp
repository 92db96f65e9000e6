#include "idl/wire/codec.h"
#include "tests/server/session/registry_session.h"

namespace tenon::session {
namespace {

using test::kLeftHand;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class RegistryCommands : public RegistrySession {};

TEST_F(RegistryCommands, AClearedEmergencyStopLeavesTheRunPaused) {
  registry_.updatePhase(RunPhase::kRunning);
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

TEST_F(RegistryCommands, ARepeatedCommandGetsTheFormerAckAndIsNotAppliedAgain) {
  const Welcome welcome = join("b", Role::kInstructor);
  const ClientId instructor = welcome.client;
  registry_.updatePhase(RunPhase::kRunning);
  const Command pause{instructor, 7, CommandKind::kPause};
  EXPECT_EQ(registry_.previousAck(pause), nullptr);
  EXPECT_TRUE(registry_.handleCommand(pause).accepted);
  registry_.updatePhase(RunPhase::kPaused);
  ASSERT_NE(registry_.previousAck(pause), nullptr);
  EXPECT_TRUE(registry_.previousAck(pause)->accepted) << "although a new command would be refused now";
  EXPECT_EQ(registry_.previousAck({instructor, 8, CommandKind::kPause}), nullptr);
  EXPECT_EQ(registry_.previousAck({ClientId{9}, 7, CommandKind::kPause}), nullptr);
  registry_.leave(instructor);
  ASSERT_EQ(join("c", Role::kInstructor, {}, "seat of b").client, instructor);
  EXPECT_EQ(registry_.previousAck(pause), nullptr) << "a rejoined client numbers its commands anew";
}

TEST_F(RegistryCommands, CommandsBetweenTwoTicksAreJudgedByThePendingPhase) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  EXPECT_TRUE(command(instructor, CommandKind::kPause).accepted);
  registry_.updatePhase(RunPhase::kRunning);  // of a tick that was computed before
  EXPECT_THAT(command(instructor, CommandKind::kPause).reason, HasSubstr("paused already"));
  EXPECT_TRUE(command(instructor, CommandKind::kResume).accepted);
  EXPECT_THAT(command(instructor, CommandKind::kResume).reason, HasSubstr("not paused"));
  registry_.updatePhase(RunPhase::kPaused);
  registry_.updatePhase(RunPhase::kRunning);
  EXPECT_TRUE(command(instructor, CommandKind::kPause).accepted);
  registry_.updatePhase(RunPhase::kStopped);
  EXPECT_THAT(command(instructor, CommandKind::kResume).reason, HasSubstr("over"));
}

TEST_F(RegistryCommands, CommandsArePermittedByRole) {
  registry_.updatePhase(RunPhase::kRunning);
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
    registry_.updatePhase(kind == CommandKind::kResume ? RunPhase::kPaused : RunPhase::kRunning);
    EXPECT_TRUE(command(instructor, kind, "part bay").accepted);
  }
  EXPECT_EQ(changes().size(), 6U);
  EXPECT_TRUE(command(trainee, CommandKind::kFulfilled).accepted);
  EXPECT_THAT(command(instructor, static_cast<CommandKind>(99)).reason, HasSubstr("unknown command"));

  const CommandAck ack = command(instructor, CommandKind::kPause);
  EXPECT_EQ(ack.client, instructor);
  EXPECT_EQ(ack.id, commands_) << "the ack carries the id of its command";
}

TEST_F(RegistryCommands, AWelcomeSaysWhichCommandsTheRoleMaySend) {
  registry_.updatePhase(RunPhase::kRunning);
  for (const RoleRights& row : kRoles) {
    const Welcome welcome = join(std::string(roleName(row.role)), row.role);
    for (const CommandKind kind : kCommandKinds) {
      const bool is_permitted = (welcome.permitted_commands & bitOf(kind)) != 0;
      const char* const text = kind == CommandKind::kGuide ? "off" : "";  // which every guided hand may say
      EXPECT_EQ(command(welcome.client, kind, text).refusal != Refusal::kNotPermitted, is_permitted)
          << roleName(row.role) << ", " << static_cast<int>(kind);
    }
  }
  EXPECT_EQ(join("x", Role::kObserver).permitted_commands, 0U);
}

TEST_F(RegistryCommands, StepsAreNamedByNameOrNumber) {
  registry_.updatePhase(RunPhase::kRunning);
  const ClientId instructor = join("b", Role::kInstructor).client;
  (void)changes();
  for (const std::string text : {"2", "mount"})
    EXPECT_TRUE(command(instructor, CommandKind::kGoToStep, text).accepted) << text;
  for (const std::string text : {"0", "3", "mounting", "", "1 ", "-1"})
    EXPECT_THAT(command(instructor, CommandKind::kGoToStep, text).reason, HasSubstr("no step")) << text;
  for (const Change& change : changes()) EXPECT_EQ(change.game.signal, 1U);
}

TEST_F(RegistryCommands, AnObjectIsHandedToAHandThatSomebodyMoves) {
  registry_.updatePhase(RunPhase::kRunning);
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

TEST_F(RegistryCommands, ATrackedHandIsHandedNothing) {
  game_control::ScenarioFile scenario = *loaded_.scenario;
  scenario.hands[kLeftHand.value].kind = simulation::HandKind::kTracked;
  SessionRegistry registry(scenario, kEpoch, false);
  const ClientId instructor = registry
                                  .join({.client_guid = "b", .role = Role::kInstructor, .seat_key = "seat"},
                                        {.seat = true, .key = true}, 5)
                                  .client;
  registry.updatePhase(RunPhase::kRunning);
  EXPECT_THAT(registry.handleCommand({instructor, 1, CommandKind::kHandOver, {}, "part left"}).reason,
              HasSubstr("hand 'left' is tracked"));
}

TEST_F(RegistryCommands, ARefusalHasAKindForDisplays) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ClientId trainee = join("a", Role::kTrainee).client;
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kWaiting);
  registry_.updatePhase(RunPhase::kRunning);
  EXPECT_EQ(command(ClientId{}, CommandKind::kSkipStep).refusal, Refusal::kNotJoined);
  EXPECT_EQ(command(trainee, CommandKind::kSkipStep).refusal, Refusal::kNotPermitted);
  EXPECT_EQ(command(instructor, CommandKind::kResume).refusal, Refusal::kAlready);
  EXPECT_EQ(command(instructor, CommandKind::kGoToStep, "nowhere").refusal, Refusal::kUnknownName);
  EXPECT_EQ(command(instructor, CommandKind::kHandOver, "part right").refusal, Refusal::kNobodyThere);
  EXPECT_EQ(command(instructor, CommandKind::kHandOver, "bay right").refusal, Refusal::kNotHoldable);
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kNone);
  registry_.updatePhase(RunPhase::kSucceeded);
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kOver);
}

TEST_F(RegistryCommands, FrozenForcesAreAChange) {
  const ClientId instructor = join("b", Role::kInstructor).client;
  (void)changes();
  EXPECT_EQ(command(instructor, CommandKind::kFreezeForces, {}, 1.0).refusal, Refusal::kWaiting);
  registry_.updatePhase(RunPhase::kPaused);
  EXPECT_TRUE(command(instructor, CommandKind::kFreezeForces, {}, 1.0).accepted);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].kind, ChangeKind::kFreezeForces);
  EXPECT_EQ(taken[0].value, 1.0);
}

TEST_F(RegistryCommands, ANoteChangesNothing) {
  registry_.updatePhase(RunPhase::kRunning);
  const ClientId trainee = join("a", Role::kTrainee, {"right"}).client;
  const ClientId observer = join("c", Role::kObserver).client;
  (void)changes();
  EXPECT_TRUE(command(trainee, CommandKind::kNote, "slipped twice").accepted);
  EXPECT_FALSE(command(trainee, CommandKind::kNote, "").accepted);
  EXPECT_FALSE(command(observer, CommandKind::kNote, "hello").accepted);
  EXPECT_TRUE(changes().empty());
}

// it would be in the next checkpoint, which no reader takes

TEST_F(RegistryCommands, ACommandWithAValueThatIsNotFiniteIsRefused) {
  registry_.updatePhase(RunPhase::kRunning);
  const ClientId instructor = join("a", Role::kInstructor).client;
  (void)changes();
  const CommandAck ack = registry_.handleCommand(
      {.client = instructor, .id = 1, .kind = CommandKind::kSkipStep, .value = std::nan("")});
  EXPECT_FALSE(ack.accepted);
  EXPECT_THAT(ack.reason, HasSubstr("not a finite number"));
  EXPECT_TRUE(changes().empty());
}

TEST_F(RegistryCommands, NamesInCommandsAreResolvedToIndices) {
  registry_.updatePhase(RunPhase::kRunning);
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

TEST_F(RegistryCommands, AClientReleasesAndSwapsOnlyHandsItControls) {
  registry_.updatePhase(RunPhase::kRunning);
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

TEST_F(RegistryCommands, WhereNothingCanBeSwappedOrNoStepIsBeforeTheyAreRefusedInWords) {
  game_control::ScenarioFile scenario = *loaded_.scenario;
  scenario.hands[test::kLeftHand.value].role = Role::kInstructor;
  SessionRegistry one_hand(scenario, kEpoch, false);
  SessionRegistry two_hands(*loaded_.scenario, kEpoch, false);
  const JoinProofs proofs{.seat = true, .key = true};
  std::uint32_t id = 0;
  const auto command = [&](SessionRegistry& registry, CommandKind kind) {
    const ClientId client = registry.join({.client_guid = "b", .role = Role::kInstructor}, proofs, 5).client;
    registry.updatePhase(RunPhase::kRunning);
    return registry.handleCommand({client, ++id, kind});
  };
  EXPECT_THAT(command(one_hand, CommandKind::kSwapHands).reason, HasSubstr("two hands are swapped"));
  EXPECT_TRUE(command(two_hands, CommandKind::kSwapHands).accepted);
  SessionRegistry of_steps(*loaded_.scenario, kEpoch, false);
  of_steps.updateStep(0);
  EXPECT_THAT(command(of_steps, CommandKind::kBack).reason, HasSubstr("no step before the first one"));
  EXPECT_TRUE(command(of_steps, CommandKind::kSkipStep).accepted);
  EXPECT_TRUE(command(of_steps, CommandKind::kBack).accepted) << "it is in the second step by then";
  SessionRegistry later(*loaded_.scenario, kEpoch, false);
  later.updateStep(1);
  EXPECT_TRUE(command(later, CommandKind::kBack).accepted);
}

TEST_F(RegistryCommands, CommandsThatCannotTakeEffectNowAreRefusedWithAReason) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  const auto answer = [&](CommandKind kind) { return command(instructor, kind).reason; };
  (void)changes();
  for (const CommandKind kind : {CommandKind::kFulfilled, CommandKind::kPause, CommandKind::kResume,
                                 CommandKind::kReset, CommandKind::kSkipStep, CommandKind::kSwapHands})
    EXPECT_THAT(answer(kind), HasSubstr("waits for people"));
  EXPECT_THAT(command(instructor, CommandKind::kRelease, "left").reason, HasSubstr("waits for people"));
  EXPECT_THAT(command(instructor, CommandKind::kSignal, "bell").reason, HasSubstr("waits for people"));
  EXPECT_TRUE(changes().empty());

  registry_.updatePhase(RunPhase::kRunning);
  EXPECT_THAT(answer(CommandKind::kResume), HasSubstr("not paused"));
  EXPECT_THAT(answer(CommandKind::kPause), IsEmpty());
  registry_.updatePhase(RunPhase::kPaused);
  EXPECT_THAT(answer(CommandKind::kPause), HasSubstr("paused already"));
  EXPECT_THAT(answer(CommandKind::kResume), IsEmpty());
  registry_.updatePhase(RunPhase::kSucceeded);
  EXPECT_THAT(answer(CommandKind::kReset), HasSubstr("over"));
}

TEST_F(RegistryCommands, WhatChangesTheSceneIsRefusedWhileAStopStandsAndTakenInThePauseAfterIt) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  registry_.engageEmergencyStop();
  EXPECT_THAT(command(instructor, CommandKind::kGoToStep, "1").reason, HasSubstr("clear it first"));
  EXPECT_THAT(command(instructor, CommandKind::kReset).reason, HasSubstr("clear it first"));
  EXPECT_TRUE(command(instructor, CommandKind::kNote, "a note").accepted);
  EXPECT_TRUE(command(instructor, CommandKind::kFreezeForces, {}, 1.0).accepted);
  EXPECT_TRUE(command(instructor, CommandKind::kClearEmergencyStop).accepted);
  EXPECT_TRUE(command(instructor, CommandKind::kGoToStep, "1").accepted);
}

// nothing takes changes while a session waits for people
TEST_F(RegistryCommands, ChangesThatWaitAreLimitedAndDoNotDelayAStop) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  (void)changes();
  for (std::size_t i = 0; i < SessionRegistry::kMostWaitingChanges; ++i)
    ASSERT_TRUE(command(instructor, CommandKind::kSetCollision, "bay part", 0.0).accepted) << i;
  EXPECT_EQ(command(instructor, CommandKind::kSetCollision, "bay part", 0.0).refusal, Refusal::kTooMany);
  registry_.engageEmergencyStop();
  const auto first = changes();
  ASSERT_FALSE(first.empty());
  EXPECT_EQ(first[0].kind, ChangeKind::kSetEmergencyStop);
  EXPECT_TRUE(command(instructor, CommandKind::kSetCollision, "bay part", 0.0).accepted);
}

// of commands that may end a step the state machine takes one a tick, of which sixteen may come with each
TEST_F(RegistryCommands, NoCommandThatWasAcceptedIsLostHoweverManyWait) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  (void)changes();
  std::uint64_t accepted = 0, taken = 0, waiting = 0;
  std::size_t refused = 0;
  for (int tick = 0; tick < 100; ++tick) {
    for (std::size_t i = 0; i < kMaxChanges; ++i) {
      const CommandAck ack = command(instructor, CommandKind::kSkipStep);
      ack.accepted ? ++accepted : ++refused;
      if (!ack.accepted) {
        EXPECT_EQ(ack.refusal, Refusal::kTooMany);
      }
    }
    const std::size_t arrived = changes().size();
    taken += arrived;
    waiting += arrived;
    ASSERT_LE(waiting, kMostWaitingCommands) << "the simulation has no place for more";
    if (waiting > 0) --waiting;
    registry_.updateCommands({taken, waiting});
  }
  EXPECT_GT(refused, 0U);
  EXPECT_GE(accepted, kMostWaitingCommands);
  EXPECT_TRUE(command(instructor, CommandKind::kPause).accepted) << "it waits for none of them";
  registry_.updateCommands({taken, 0});
  EXPECT_TRUE(command(instructor, CommandKind::kSkipStep).accepted);
}

TEST_F(RegistryCommands, CommandsOfACheckpointCount) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  registry_.updateCommands({0, kMostWaitingCommands});
  EXPECT_EQ(command(instructor, CommandKind::kSkipStep).refusal, Refusal::kTooMany);
  registry_.updateCommands({0, kMostWaitingCommands - 1});
  EXPECT_TRUE(command(instructor, CommandKind::kSkipStep).accepted);
}

TEST_F(RegistryCommands, AStopIsNotLiftedByTheEndOfAnEarlierOneThatStillWaits) {
  join("t", Role::kInstructor);
  registry_.engageEmergencyStop();
  (void)changes();
  registry_.clearEmergencyStop();
  registry_.engageEmergencyStop();
  double engaged = 0.0;
  for (const Change& change : changes())
    if (change.kind == ChangeKind::kSetEmergencyStop) engaged = change.value;
  EXPECT_EQ(engaged, 1.0);
}

TEST_F(RegistryCommands, AReasonCanBeSentAndNamesWhatThereIsHoweverLongTheUnknownNameIs) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  const std::string unknown(255, 'x');
  for (const CommandKind kind :
       {CommandKind::kSignal, CommandKind::kRelease, CommandKind::kGoToStep, CommandKind::kHandOver,
        CommandKind::kSetCollision, CommandKind::kKick, CommandKind::kGuide}) {
    const std::string text = kind == CommandKind::kGuide ? "show " + unknown.substr(5) : unknown;
    const CommandAck ack = command(instructor, kind, text);
    EXPECT_EQ(ack.refusal, Refusal::kUnknownName) << static_cast<int>(kind);
    EXPECT_TRUE(wire::encode(ack)) << ack.reason;
  }
  EXPECT_THAT(command(instructor, CommandKind::kRelease, "third").reason,
              HasSubstr("it has: right, instructor, left"));
  EXPECT_THAT(command(instructor, CommandKind::kKick, "Eve").reason, HasSubstr("it has: t's station"));
  EXPECT_THAT(command(instructor, CommandKind::kGuide, "show third").reason,
              HasSubstr("it has: right, left"));
}

TEST_F(RegistryCommands, AHandIsReleasedByItsName) {
  const ClientId instructor = join("t", Role::kInstructor).client;
  registry_.updatePhase(RunPhase::kRunning);
  (void)changes();
  EXPECT_TRUE(command(instructor, CommandKind::kRelease, "left").accepted);
  const auto taken = changes();
  ASSERT_EQ(taken.size(), 1U);
  EXPECT_EQ(taken[0].hand, test::kLeftHand);
  EXPECT_THAT(command(instructor, CommandKind::kRelease, "third").reason, HasSubstr("no hand 'third'"));
}

}  // namespace
}  // namespace tenon::session
