#include "server/session/front_desk.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"

namespace tenon {
namespace {

using test::kLeftHand;
using test::kRightHand;
using test::kTeacherHand;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::uint32_t kEpoch = 77;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class FrontDeskTest : public ::testing::Test {
 protected:
  Welcome join(const std::string& guid, Role role, std::vector<std::string> hands = {},
               const std::string& token = {}) {
    return desk_.join({guid, guid + "'s station", role, std::move(hands), token}, 5);
  }
  FixedVector<Change, kMaxChanges> changes() {
    FixedVector<Change, kMaxChanges> taken;
    desk_.takeChanges(taken);
    return taken;
  }
  CommandAck command(ClientId client, CommandKind kind, const std::string& text = {}, double value = 0.0,
                     HandId hand = {}) {
    return desk_.command({client, ++commands_, kind, hand, text, value});
  }
  static DeviceInput input(ClientId client, HandId hand) {
    DeviceInput all{.hand = hand, .client = client, .server_epoch = kEpoch, .active = true};
    all.samples[0] = {.seq = 9, .X_WH = Pose(Vector3(0.1, 0.2, 0.3)), .buttons = 1};
    return all;
  }

  LoadedScene loaded_ = test::smallSession();
  FrontDesk desk_{*loaded_.scenario, kEpoch, false, 1};
  std::uint32_t commands_ = 0;
};

TEST_F(FrontDeskTest, LetsATraineeInAndAttachesTheHands) {
  EXPECT_THAT(desk_.freeHands(), ElementsAre("right", "instructor", "left"));
  const Welcome welcome = join("a", Role::kTrainee, {"left", "right"});
  ASSERT_TRUE(welcome.accepted) << welcome.reason;
  EXPECT_EQ(welcome.client, ClientId{1});
  EXPECT_THAT(welcome.hands, ElementsAre(kLeftHand, kRightHand)) << "in the order asked for";
  EXPECT_EQ(welcome.client_guid, "a");
  EXPECT_EQ(welcome.server_epoch, kEpoch);
  EXPECT_EQ(welcome.tick, 5U);
  EXPECT_EQ(desk_.moverOf(kRightHand), welcome.client);
  EXPECT_TRUE(desk_.roleIsHere(Role::kTrainee));
  EXPECT_THAT(desk_.freeHands(), ElementsAre("instructor"));

  const auto told = changes();
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].kind, ChangeKind::kAttach);
  EXPECT_EQ(told[0].hand, kLeftHand);
  EXPECT_EQ(told[1].hand, kRightHand);
  EXPECT_TRUE(changes().empty()) << "each is told once";
}

TEST_F(FrontDeskTest, RefusesWithASentence) {
  Join old{.client_guid = "old", .role = Role::kObserver, .protocol_version = kProtocolVersion + 1};
  EXPECT_THAT(desk_.join(old, 0).reason, HasSubstr("protocol version"));
  EXPECT_THAT(join("b", Role::kTrainee, {"instructor"}).reason, HasSubstr("belongs to the instructor"));
  EXPECT_THAT(join("c", Role::kObserver, {"right"}).reason, HasSubstr("belongs to the trainee"));
  EXPECT_THAT(join("d", static_cast<Role>(99)).reason, HasSubstr("role"));
  EXPECT_THAT(join("", Role::kObserver).reason, HasSubstr("client_guid"));
  ASSERT_TRUE(join("e", Role::kTrainee, {"right"}).accepted);
  const Welcome late = join("f", Role::kTrainee, {"left", "right"});
  EXPECT_FALSE(late.accepted);
  EXPECT_THAT(late.reason, HasSubstr("'right' is already moved"));
  EXPECT_FALSE(late.client.valid());
  EXPECT_FALSE(desk_.moverOf(kLeftHand).valid()) << "a refused client gets none of the hands it asked for";
  EXPECT_EQ(desk_.people().size(), 1U);
}

TEST_F(FrontDeskTest, AHandTheScenarioDoesNotHaveIsLeftOutInItsPlace) {
  const Welcome welcome = join("a", Role::kTrainee, {"head", "right", "arm"});
  ASSERT_TRUE(welcome.accepted) << welcome.reason;
  EXPECT_THAT(welcome.hands, ElementsAre(HandId{}, kRightHand, HandId{}));
  EXPECT_EQ(changes().size(), 1U);
}

TEST_F(FrontDeskTest, TheSameQuestionAgainGetsTheSameAnswer) {
  const Welcome first = join("a", Role::kTrainee, {"right"});
  const Welcome again = join("a", Role::kTrainee, {"right"});
  EXPECT_TRUE(again.accepted);
  EXPECT_EQ(again.client, first.client);
  EXPECT_EQ(again.token, first.token);
  EXPECT_EQ(again.hands, first.hands);
  EXPECT_EQ(desk_.people().size(), 1U);
  EXPECT_EQ(changes().size(), 1U) << "and is attached once";
}

TEST_F(FrontDeskTest, ATokenComesBackAsTheSameClient) {
  const Welcome first = join("a", Role::kTrainee, {"right"});
  const Welcome other = join("b", Role::kObserver);
  ASSERT_NE(first.token, other.token);
  desk_.leave(first.client);
  EXPECT_EQ(join("c", Role::kTrainee, {"right"}, first.token).client, first.client);
  EXPECT_EQ(desk_.guidOf(first.client), "c");

  // a station that was restarted before its old self was missed
  (void)changes();
  const Welcome again = join("d", Role::kTrainee, {"right"}, first.token);
  EXPECT_TRUE(again.accepted) << again.reason;
  EXPECT_EQ(again.client, first.client);
  const auto told = changes();
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].kind, ChangeKind::kDetach);
  EXPECT_EQ(told[1].kind, ChangeKind::kAttach);
  EXPECT_EQ(desk_.people().size(), 2U);

  EXPECT_EQ(join("e", Role::kObserver, {}, "no such token").client, ClientId{3});
}

TEST_F(FrontDeskTest, WhoLeavesFreesTheHands) {
  const Welcome welcome = join("a", Role::kTrainee, {"right", "left"});
  (void)changes();
  desk_.leave(welcome.client);
  desk_.leave(welcome.client);
  desk_.leave(ClientId{99});
  desk_.leave(ClientId{});
  const auto told = changes();
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].kind, ChangeKind::kDetach);
  EXPECT_FALSE(desk_.person(welcome.client)->alive);
  EXPECT_FALSE(desk_.roleIsHere(Role::kTrainee));
  EXPECT_FALSE(desk_.reading(input(welcome.client, kRightHand)));
  EXPECT_FALSE(command(welcome.client, CommandKind::kFulfilled).accepted);
  EXPECT_TRUE(join("b", Role::kTrainee, {"right"}).accepted);
}

TEST_F(FrontDeskTest, TakesAReadingOfAClientsOwnHandOver) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto reading = desk_.reading(input(client, kRightHand));
  ASSERT_TRUE(reading) << reading.error().what;
  EXPECT_EQ(reading->hand, kRightHand);
  EXPECT_EQ(reading->seq, 9U);
  EXPECT_TRUE(reading->active);
  EXPECT_EQ(reading->buttons, 1U);
  EXPECT_EQ(reading->X_WH.translation(), Vector3(0.1, 0.2, 0.3));
}

TEST_F(FrontDeskTest, AnswersACommandThatIsAskedAgainWithoutDoingItAgain) {
  const Welcome welcome = join("b", Role::kInstructor);
  const ClientId teacher = welcome.client;
  desk_.follow(RunPhase::kRunning, false);
  const Command pause{teacher, 7, CommandKind::kPause};
  EXPECT_EQ(desk_.answerTo(pause), nullptr);
  EXPECT_TRUE(desk_.command(pause).accepted);
  desk_.follow(RunPhase::kPaused, false);
  ASSERT_NE(desk_.answerTo(pause), nullptr);
  EXPECT_TRUE(desk_.answerTo(pause)->accepted) << "though a new one would be refused now";
  EXPECT_EQ(desk_.answerTo({teacher, 8, CommandKind::kPause}), nullptr);
  EXPECT_EQ(desk_.answerTo({ClientId{9}, 7, CommandKind::kPause}), nullptr);
  desk_.leave(teacher);
  ASSERT_EQ(join("c", Role::kInstructor, {}, welcome.token).client, teacher);
  EXPECT_EQ(desk_.answerTo(pause), nullptr) << "a program that took the seat over counts anew";
}

TEST_F(FrontDeskTest, CommandsThatComeFasterThanTicksAreJudgedByWhatWasDecided) {
  const ClientId teacher = join("b", Role::kInstructor).client;
  desk_.follow(RunPhase::kRunning, false);
  EXPECT_TRUE(command(teacher, CommandKind::kPause).accepted);
  desk_.follow(RunPhase::kRunning, false);  // a tick that was under way already
  EXPECT_THAT(command(teacher, CommandKind::kPause).reason, HasSubstr("paused already"));
  EXPECT_TRUE(command(teacher, CommandKind::kResume).accepted);
  EXPECT_THAT(command(teacher, CommandKind::kResume).reason, HasSubstr("not paused"));
  desk_.follow(RunPhase::kPaused, false);
  desk_.follow(RunPhase::kRunning, false);
  EXPECT_TRUE(command(teacher, CommandKind::kPause).accepted);
  desk_.follow(RunPhase::kStopped, false);
  EXPECT_THAT(command(teacher, CommandKind::kResume).reason, HasSubstr("over"));
}

TEST_F(FrontDeskTest, RefusesReadingsOfOthers) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const ClientId teacher = join("b", Role::kInstructor, {"instructor"}).client;
  DeviceInput stale = input(client, kRightHand);
  stale.server_epoch = kEpoch - 1;
  EXPECT_THAT(desk_.reading(stale).error().what, HasSubstr("earlier run"));
  EXPECT_THAT(desk_.reading(input(client, kTeacherHand)).error().what, HasSubstr("not its own"));
  EXPECT_THAT(desk_.reading(input(teacher, kRightHand)).error().what, HasSubstr("not its own"));
  EXPECT_THAT(desk_.reading(input(client, kLeftHand)).error().what, HasSubstr("not its own"));
  EXPECT_THAT(desk_.reading(input(client, HandId{17})).error().what, HasSubstr("does not have"));
  EXPECT_FALSE(desk_.reading(input(client, HandId{})));
  EXPECT_FALSE(desk_.reading(input(ClientId{}, kLeftHand))) << "nobody is not the mover of a free hand";
}

TEST_F(FrontDeskTest, RefusesNumbersThatAreNoPose) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto refuses = [&](auto&& spoil) {
    DeviceInput bad = input(client, kRightHand);
    spoil(bad.samples[0]);
    return !desk_.reading(bad);
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

TEST_F(FrontDeskTest, CommandsAreForThoseWhoAreMeant) {
  desk_.follow(RunPhase::kRunning, false);
  const ClientId trainee = join("a", Role::kTrainee, {"right"}).client;
  const ClientId teacher = join("b", Role::kInstructor).client;
  const ClientId observer = join("c", Role::kObserver).client;
  const ClientId recorder = join("d", Role::kRecorder).client;
  (void)changes();
  EXPECT_EQ(command(ClientId{}, CommandKind::kFulfilled).reason, "join first");
  EXPECT_THAT(command(observer, CommandKind::kFulfilled).reason, HasSubstr("not for the observer"));
  EXPECT_THAT(command(recorder, CommandKind::kStop).reason, HasSubstr("not for the recorder"));
  for (const CommandKind kind : {CommandKind::kPause, CommandKind::kResume, CommandKind::kReset,
                                 CommandKind::kSkipStep, CommandKind::kStop, CommandKind::kSetCollision}) {
    EXPECT_THAT(command(trainee, kind, "part bay").reason, HasSubstr("ask the instructor"));
    desk_.follow(kind == CommandKind::kResume ? RunPhase::kPaused : RunPhase::kRunning, false);
    EXPECT_TRUE(command(teacher, kind, "part bay").accepted);
  }
  EXPECT_EQ(changes().size(), 6U);
  EXPECT_TRUE(command(trainee, CommandKind::kFulfilled).accepted);
  EXPECT_THAT(command(teacher, static_cast<CommandKind>(99)).reason, HasSubstr("unknown command"));

  const CommandAck ack = command(teacher, CommandKind::kPause);
  EXPECT_EQ(ack.client, teacher);
  EXPECT_EQ(ack.id, commands_) << "the answer names its question";
}

TEST_F(FrontDeskTest, NamesInCommandsBecomeNumbers) {
  desk_.follow(RunPhase::kRunning, false);
  const ClientId teacher = join("a", Role::kInstructor).client;
  EXPECT_THAT(command(teacher, CommandKind::kSignal, "whistle").reason, HasSubstr("'whistle'"));
  EXPECT_TRUE(command(teacher, CommandKind::kSignal, "bell").accepted);
  for (const std::string wrong : {"", "part", "part nothing", "part part", " ", "part  bay"})
    EXPECT_FALSE(command(teacher, CommandKind::kSetCollision, wrong).accepted) << wrong;
  EXPECT_TRUE(command(teacher, CommandKind::kSetCollision, "bay part", 0.0).accepted);

  const auto told = changes();
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].kind, ChangeKind::kGame);
  EXPECT_EQ(told[0].game.kind, CommandKind::kSignal);
  EXPECT_EQ(loaded_.scenario->signals[told[0].game.signal], "bell");
  EXPECT_EQ(told[1].kind, ChangeKind::kPair);
  const ScenarioPair& pair = loaded_.scenario->pairs[told[1].index];
  EXPECT_EQ(pair.a.value + pair.b.value, 1U) << "bay is object 0, part object 1";
  EXPECT_EQ(told[1].value, 0.0);
}

TEST_F(FrontDeskTest, OnlyOnesOwnHandLetsGoOrSwaps) {
  desk_.follow(RunPhase::kRunning, false);
  const ClientId one = join("a", Role::kTrainee, {"right"}).client;
  const ClientId other = join("b", Role::kTrainee, {"left"}).client;
  const ClientId teacher = join("c", Role::kInstructor, {"instructor"}).client;
  EXPECT_TRUE(command(one, CommandKind::kRelease, {}, 0.0, kRightHand).accepted);
  EXPECT_FALSE(command(other, CommandKind::kRelease, {}, 0.0, kRightHand).accepted);
  EXPECT_TRUE(command(teacher, CommandKind::kRelease, {}, 0.0, kRightHand).accepted);
  EXPECT_FALSE(command(teacher, CommandKind::kRelease, {}, 0.0, HandId{17}).accepted);
  EXPECT_FALSE(command(one, CommandKind::kSwapHands, {}, kNan).accepted) << "half of the hands are another's";
  EXPECT_TRUE(command(teacher, CommandKind::kSwapHands).accepted);
  desk_.leave(other);
  desk_.leave(one);
  const ClientId both = join("d", Role::kTrainee, {"right", "left"}).client;
  EXPECT_TRUE(command(both, CommandKind::kSwapHands).accepted);
}

TEST_F(FrontDeskTest, ForcesFromOutsideAreLimited) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId observer = join("b", Role::kObserver).client;
  const ForceContribution push{.source = 4,
                               .client = trainee,
                               .object = ObjectId{1},
                               .F_Oo_W = {Vector3(0, 0, 5), Vector3::Zero()},
                               .lifetime_ticks = 1'000'000};
  const auto change = desk_.contribution(push);
  ASSERT_TRUE(change) << change.error().what;
  EXPECT_EQ(change->kind, ChangeKind::kContribute);
  EXPECT_EQ(change->object, ObjectId{1});
  EXPECT_EQ(change->index, 4U);
  EXPECT_EQ(change->lifetime_ticks, 100U) << "a source that has died does not push on";
  EXPECT_EQ(change->F_Oo_W.force, Vector3(0, 0, 5));

  const auto refuses = [&](auto&& spoil) {
    ForceContribution bad = push;
    spoil(bad);
    return !desk_.contribution(bad);
  };
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = observer; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = ClientId{9}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = ObjectId{99}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = {}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.force = Vector3(0, 0, 201); }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.torque = Vector3(0, kNan, 0); }));
}

TEST_F(FrontDeskTest, OnlyATeachersTrackerPlacesObjects) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId teacher = join("b", Role::kInstructor).client;
  const ExternalPose pose{.object = ObjectId{1}, .client = teacher, .X_WO = Pose(Vector3(1, 0, 0))};
  ASSERT_TRUE(desk_.externalPose(pose));
  EXPECT_EQ(desk_.externalPose(pose)->kind, ChangeKind::kPlace);
  ExternalPose bad = pose;
  bad.client = trainee;
  EXPECT_FALSE(desk_.externalPose(bad));
  bad = pose;
  bad.object = ObjectId{99};
  EXPECT_FALSE(desk_.externalPose(bad));
  bad = pose;
  bad.X_WO = Pose(Vector3(0, 0, kNan));
  EXPECT_FALSE(desk_.externalPose(bad));
}

TEST_F(FrontDeskTest, MoreChangesThanATickTakesWaitForTheNext) {
  for (int i = 0; i < 40; ++i) desk_.emergencyStop({.engaged = i % 2 == 0});
  EXPECT_EQ(changes().size(), kMaxChanges);
  EXPECT_EQ(changes().size(), kMaxChanges);
  const auto rest = changes();
  ASSERT_EQ(rest.size(), 40 - 2 * kMaxChanges);
  EXPECT_EQ(rest[0].kind, ChangeKind::kHalt);
  EXPECT_EQ(rest[0].value, 1.0) << "number 32, in order";
}

TEST_F(FrontDeskTest, ASeatBelongsToTheProgramThatTookIt) {
  const Origin ada{{1, 2, 3}};
  const Origin rogue{{9, 9, 9}};
  const Join join{"a", "Ada", Role::kTrainee, {"right"}};
  const Welcome welcome = desk_.join(join, 0, ada);
  EXPECT_TRUE(desk_.isFrom(welcome.client, ada));
  EXPECT_FALSE(desk_.isFrom(welcome.client, rogue));
  (void)desk_.join(join, 0, rogue);
  EXPECT_TRUE(desk_.isFrom(welcome.client, ada)) << "asking as somebody else moves no seat";
  EXPECT_FALSE(desk_.isFrom(ClientId{9}, ada));
}

TEST_F(FrontDeskTest, WhatCannotBeDoneNowIsRefusedWithTheReason) {
  const ClientId teacher = join("t", Role::kInstructor).client;
  const auto answer = [&](CommandKind kind) { return command(teacher, kind).reason; };
  (void)changes();
  for (const CommandKind kind : {CommandKind::kFulfilled, CommandKind::kPause, CommandKind::kResume,
                                 CommandKind::kReset, CommandKind::kSkipStep, CommandKind::kSwapHands})
    EXPECT_THAT(answer(kind), HasSubstr("waits for people"));
  EXPECT_THAT(command(teacher, CommandKind::kSignal, "bell").reason, HasSubstr("waits for people"));
  EXPECT_TRUE(changes().empty());

  desk_.follow(RunPhase::kRunning, false);
  EXPECT_THAT(answer(CommandKind::kResume), HasSubstr("not paused"));
  EXPECT_THAT(answer(CommandKind::kPause), IsEmpty());
  desk_.follow(RunPhase::kPaused, false);
  EXPECT_THAT(answer(CommandKind::kPause), HasSubstr("paused already"));
  EXPECT_THAT(answer(CommandKind::kResume), IsEmpty());
  desk_.follow(RunPhase::kSucceeded, false);
  EXPECT_THAT(answer(CommandKind::kReset), HasSubstr("over"));
}

TEST_F(FrontDeskTest, NoMoreIsHeldBackThanTheSessionCanTakeWhenItGoesOn) {
  const ClientId teacher = join("t", Role::kInstructor).client;
  desk_.follow(RunPhase::kPaused, false);
  for (std::size_t i = 0; i < kMaxChanges; ++i)
    EXPECT_TRUE(command(teacher, CommandKind::kFulfilled).accepted) << i;
  EXPECT_THAT(command(teacher, CommandKind::kFulfilled).reason, HasSubstr("wait already"));
  EXPECT_TRUE(command(teacher, CommandKind::kResume).accepted);
  desk_.follow(RunPhase::kRunning, false);
  EXPECT_TRUE(command(teacher, CommandKind::kFulfilled).accepted);
}

TEST_F(FrontDeskTest, AHandIsReleasedByItsName) {
  const ClientId teacher = join("t", Role::kInstructor).client;
  (void)changes();
  EXPECT_TRUE(command(teacher, CommandKind::kRelease, "left").accepted);
  const auto told = changes();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].hand, kLeftHand);
  EXPECT_THAT(command(teacher, CommandKind::kRelease, "third").reason, HasSubstr("no hand 'third'"));
}

}  // namespace
}  // namespace tenon
