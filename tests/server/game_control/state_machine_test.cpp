#include "server/game_control/state_machine.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/game_control/exercise.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

using test::Exercise;
using test::smallScenario;
using test::with;

GameCommand command(CommandKind kind) { return GameCommand{.kind = kind, .hand = HandId{0}}; }

TEST(StateMachine, LeadsFromTheTouchToTheMountedPart) {
  Exercise exercise(smallScenario());
  EXPECT_EQ(exercise.status().phase, StepPhase::kActive);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kParked) << "the part appears";

  exercise.touchPart();
  EXPECT_EQ(exercise.status().step, 1U);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kHeld) << "it replaces the pointer";
  EXPECT_EQ(exercise.object("pointer").status, ObjectStatus::kHidden);
  EXPECT_NEAR(exercise.status().position_error, Vector3(0.2, 0, 0.12).norm(), 0.005);

  exercise.insertPart();
  exercise.step(100);
  EXPECT_TRUE(exercise.status().finished);
  EXPECT_EQ(exercise.status().phase, StepPhase::kDone);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kFixed);
  EXPECT_EQ(exercise.object("part").X_WO.translation(), Vector3(0, 0, -0.02)) << "exactly at its target";
  EXPECT_EQ(exercise.object("pointer").status, ObjectStatus::kHeld) << "the pointer is back";
}

TEST(StateMachine, AShortTouchTakesNothing) {
  Exercise exercise(smallScenario());
  exercise.moveTo(Vector3(0.2, 0, 0.129));
  exercise.moveTo(Vector3(0.2, 0, 0.2));
  exercise.step(200);
  EXPECT_EQ(exercise.status().step, 0U);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kParked);
}

TEST(StateMachine, EveryEndingHasARevisionOfItsOwn) {
  Exercise exercise(with(smallScenario(), "touch: part\n    for: 0.1 s", "show: [part]"));
  const std::uint32_t before = exercise.status().revision;
  exercise.step({command(CommandKind::kFulfilled)});
  EXPECT_EQ(exercise.status().step, 0U);
  EXPECT_EQ(exercise.status().phase, StepPhase::kDone);
  EXPECT_EQ(exercise.status().revision, before + 1);
  exercise.step(1);
  EXPECT_EQ(exercise.status().step, 1U);
  EXPECT_EQ(exercise.status().phase, StepPhase::kActive);
  EXPECT_EQ(exercise.status().revision, before + 2);
}

TEST(StateMachine, AStateThatTakesTooLongFailsOrIsSkipped) {
  const std::string quick = with(smallScenario(), "for: 0.1 s", "for: 0.1 s\n    timeout: 0.2 s");
  Exercise fails(quick);
  fails.step(199);
  EXPECT_EQ(fails.status().phase, StepPhase::kActive);
  fails.step(1);
  EXPECT_EQ(fails.status().phase, StepPhase::kTimedOut);
  EXPECT_TRUE(fails.status().failed);
  fails.step(100);
  EXPECT_EQ(fails.status().step, 0U) << "a failed exercise stays where it is";

  Exercise skips(with(quick, "timeout: 0.2 s", "timeout: 0.2 s\n    on_timeout: skip"));
  skips.step(200);
  EXPECT_EQ(skips.status().phase, StepPhase::kTimedOut);
  skips.step(1);
  EXPECT_EQ(skips.status().step, 1U);
  EXPECT_FALSE(skips.status().failed);
}

TEST(StateMachine, SkippingAMountPutsThePartWhereItBelongs) {
  Exercise exercise(smallScenario());
  exercise.step({command(CommandKind::kSkipStep)});
  EXPECT_EQ(exercise.status().phase, StepPhase::kSkipped);
  exercise.step(10);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kHeld);
  exercise.step({command(CommandKind::kSkipStep)});
  EXPECT_TRUE(exercise.status().finished);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kFixed);
  EXPECT_EQ(exercise.object("part").X_WO.translation(), Vector3(0, 0, -0.02));
}

TEST(StateMachine, APartThatWasLetGoIsTakenAgainByTouch) {
  Exercise exercise(smallScenario());
  exercise.touchPart();
  exercise.step({command(CommandKind::kRelease)});
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kParked);
  EXPECT_EQ(exercise.object("pointer").status, ObjectStatus::kHeld);
  exercise.step(900);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kParked);
  exercise.step(200);
  EXPECT_EQ(exercise.object("part").status, ObjectStatus::kHeld);
}

TEST(StateMachine, AResetStartsAgain) {
  Exercise exercise(smallScenario());
  exercise.touchPart();
  exercise.step({command(CommandKind::kReset)});
  EXPECT_EQ(exercise.status().step, 0U);
  EXPECT_EQ(exercise.status().phase, StepPhase::kActive);
  EXPECT_EQ(exercise.object("part").X_WO.translation(), Vector3(0.2, 0, 0.1));
  EXPECT_EQ(exercise.object("pointer").status, ObjectStatus::kHeld);
}

TEST(StateMachine, SwitchesPairsAsStatesAndPeopleSay) {
  Exercise exercise(with(smallScenario(), "    snap: true", "    pairs_off: [[part, cube]]\n    snap: true"));
  const auto pair = static_cast<std::uint32_t>(exercise.scenario().pairOf(ObjectId{1}, ObjectId{3}));
  EXPECT_TRUE(exercise.environment().pairs()[pair].enabled);
  exercise.step({command(CommandKind::kSkipStep)});
  exercise.step(1);
  EXPECT_FALSE(exercise.environment().pairs()[pair].enabled);
  exercise.step({GameCommand{.kind = CommandKind::kSetCollision, .signal = pair, .value = 1.0}});
  EXPECT_TRUE(exercise.environment().pairs()[pair].enabled);
  exercise.step({GameCommand{.kind = CommandKind::kSetCollision, .signal = 1000, .value = 1.0}});
}

//   part ->  [cube]      a part goes through what is of its group, and is held back by it again when it left
TEST(StateMachine, PutsObjectsIntoGroupsAndTakesThemOut) {
  Exercise exercise(with(smallScenario(), "    snap: true\n    timeout: 2 s\n",
                         "    groups: {part: kit, cube: kit}\n  - name: leave\n    groups: {part: none}\n"));
  const ObjectId part = exercise.scenario().objectNamed("part");
  const ObjectId cube = exercise.scenario().objectNamed("cube");
  const Environment& environment = exercise.environment();
  exercise.touchPart();
  ASSERT_EQ(exercise.status().step, 1U);
  EXPECT_EQ(environment.groupOf(part), 1U);
  EXPECT_EQ(environment.groupOf(cube), 1U);

  const Vector3 p_PH = -environment.hands()[0].X_HO.translation();
  const auto apart = [&] {
    return (exercise.object("part").X_WO.translation() - exercise.object("cube").X_WO.translation()).x();
  };
  exercise.moveTo(Vector3(-0.2, 0, 0.2) + p_PH);
  exercise.moveTo(Vector3(-0.28, 0, 0.2) + p_PH);
  EXPECT_FALSE(environment.inContact(part, cube));
  EXPECT_NEAR(apart(), 0.02, 1e-4) << "half of each inside the other";

  exercise.moveTo(Vector3(-0.2, 0, 0.2) + p_PH);
  exercise.step({command(CommandKind::kSkipStep)});
  exercise.step(1);
  EXPECT_EQ(environment.groupOf(part), 0U);
  EXPECT_EQ(environment.groupOf(cube), 1U);
  exercise.moveTo(Vector3(-0.28, 0, 0.2) + p_PH);
  EXPECT_TRUE(environment.inContact(part, cube));
  EXPECT_GT(apart(), 0.0395);

  exercise.step({command(CommandKind::kReset)});
  EXPECT_EQ(environment.groupOf(cube), 0U) << "as the file says";
}

TEST(StateMachine, OverlappingObjectsThatLeaveTheirGroupTouchAtOnce) {
  Exercise exercise(with(smallScenario(), "    snap: true\n    timeout: 2 s\n",
                         "    groups: {part: kit, cube: kit}\n  - name: leave\n    groups: {cube: none}\n"));
  const ObjectId part = exercise.scenario().objectNamed("part");
  const ObjectId cube = exercise.scenario().objectNamed("cube");
  exercise.touchPart();
  const Vector3 p_PH = -exercise.environment().hands()[0].X_HO.translation();
  exercise.moveTo(Vector3(-0.262, 0, 0.2) + p_PH);
  EXPECT_FALSE(exercise.environment().inContact(part, cube));
  exercise.step({command(CommandKind::kSkipStep)});
  exercise.step(1);
  EXPECT_TRUE(exercise.environment().inContact(part, cube));
}

TEST(StateMachine, SwappedHandsKeepTheirRoles) {
  Exercise exercise(with(smallScenario(), "role: instructor, object: cube", "object: cube"));
  exercise.environment().setHandPresent(HandId{1}, true);
  exercise.environment().setHandPose(HandId{1}, Pose(Vector3(0.2, 0.3, 0.3)), Twist{});
  const std::uint32_t before = exercise.status().revision;
  exercise.step({command(CommandKind::kSwapHands)});
  EXPECT_EQ(exercise.status().hand, HandId{1}) << "whoever moves the pointer is meant";
  EXPECT_GT(exercise.status().revision, before);
  exercise.step({command(CommandKind::kSkipStep)});
  exercise.step(2);
  EXPECT_EQ(exercise.environment().hands()[1].object, exercise.scenario().objectNamed("part"));
}

TEST(StateMachine, TellsAPersonWhatToDoAndHowFarItIs) {
  Exercise exercise(smallScenario());
  exercise.touchPart();
  const StepState step = describe(exercise.scenario(), exercise.status());
  EXPECT_EQ(step.name, "mount");
  EXPECT_EQ(step.steps, 2U);
  EXPECT_TRUE(step.has_target);
  EXPECT_EQ(step.approach_W, Vector3(0, 0, -1));
  EXPECT_DOUBLE_EQ(step.timeout, 2.0);
  EXPECT_EQ(step.hand, HandId{0});
  const StepProgress report = progress(exercise.scenario(), exercise.status());
  ASSERT_EQ(report.conditions.size(), 1U);
  EXPECT_EQ(report.conditions[0].text, "pose of part");
  EXPECT_DOUBLE_EQ(report.conditions[0].value, report.position_error);
  EXPECT_DOUBLE_EQ(report.conditions[0].limit, 0.002);
}

TEST(StateMachine, TheSameHandMakesTheSameBits) {
  std::vector<std::uint64_t> hashes;
  for (int run = 0; run < 2; ++run) {
    Exercise exercise(smallScenario());
    exercise.touchPart();
    exercise.insertPart();
    hashes.push_back(exercise.hash());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(StateMachine, GoesOnFromASavedState) {
  Exercise one(smallScenario());
  Exercise other(smallScenario());
  one.moveTo(Vector3(0.2, 0, 0.129));
  one.step(50);
  ASSERT_TRUE(other.environment().restore(one.environment().save()));
  ASSERT_TRUE(other.machine().restore(one.machine().save()));
  EXPECT_EQ(one.hash(), other.hash());
  for (Exercise* exercise : {&one, &other}) {
    exercise->step(80);
    exercise->insertPart();
  }
  EXPECT_EQ(one.hash(), other.hash());
  EXPECT_EQ(one.status().step, 1U);
}

TEST(StateMachine, RefusesASavedStateThatIsNone) {
  Exercise exercise(smallScenario());
  EXPECT_FALSE(exercise.machine().restore(std::vector<std::uint8_t>(7)));
  std::vector<std::uint8_t> bytes = exercise.machine().save();
  bytes[8] = 77;
  const auto restored = exercise.machine().restore(bytes);
  ASSERT_FALSE(restored);
  EXPECT_NE(restored.error().what.find("step 77"), std::string::npos) << restored.error().what;
}

TEST(StateMachine, StepAllocatesNothingAndLocksNothing) {
  if (!test::RealtimeGuard::available()) GTEST_SKIP() << "a sanitizer stands before malloc";
  Exercise exercise(smallScenario());
  exercise.step(10);
  const std::vector<GameCommand> skip{command(CommandKind::kSkipStep)};
  const test::RealtimeGuard guard;
  for (int i = 0; i < 1000; ++i) exercise.machine().step(exercise.environment(), {});
  exercise.machine().step(exercise.environment(), skip);
  for (int i = 0; i < 100; ++i) exercise.machine().step(exercise.environment(), {});
  exercise.machine().step(exercise.environment(), skip);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_TRUE(exercise.status().finished);
}

}  // namespace
}  // namespace tenon
