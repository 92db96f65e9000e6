#include "server/game_control/state_machine.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/game_control/scenario_fixture.h"
#include "tests/support/realtime_guard.h"

namespace tenon::game_control {
namespace {

using test::ScenarioFixture;
using test::smallScenario;
using test::with;

GameCommand command(CommandKind kind) { return GameCommand{.kind = kind, .hand = HandId{0}}; }

TEST(StateMachine, GoesFromTouchingThePartToMountingIt) {
  test::ScenarioFixture fixture(test::smallScenario());
  EXPECT_EQ(fixture.status().phase, StepPhase::kActive);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked) << "the part appears";

  fixture.touchPart();
  EXPECT_EQ(fixture.status().step, 1U);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld) << "instead of the pointer";
  EXPECT_EQ(fixture.object("pointer").status, ObjectStatus::kHidden);
  EXPECT_NEAR(fixture.status().position_error, Vector3(0.2, 0, 0.12).norm(), 0.005);

  fixture.insertPart();
  fixture.step(100);
  EXPECT_TRUE(fixture.status().finished);
  EXPECT_EQ(fixture.status().phase, StepPhase::kDone);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kFixed);
  EXPECT_EQ(fixture.object("part").X_WO.translation(), Vector3(0, 0, -0.02)) << "exactly at its target";
  EXPECT_EQ(fixture.object("pointer").status, ObjectStatus::kHeld) << "the pointer is back";
}

TEST(StateMachine, AShortTouchGrabsNothing) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.moveTo(Vector3(0.2, 0, 0.129));
  fixture.moveTo(Vector3(0.2, 0, 0.2));
  fixture.step(200);
  EXPECT_EQ(fixture.status().step, 0U);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked);
}

TEST(StateMachine, EveryEndOfAStateHasItsOwnRevision) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "touch: part\n    for: 0.1 s", "show: [part]"));
  const std::uint32_t before = fixture.status().revision;
  fixture.step({command(CommandKind::kFulfilled)});
  EXPECT_EQ(fixture.status().step, 0U);
  EXPECT_EQ(fixture.status().phase, StepPhase::kDone);
  EXPECT_EQ(fixture.status().revision, before + 1);
  fixture.step(1);
  EXPECT_EQ(fixture.status().step, 1U);
  EXPECT_EQ(fixture.status().phase, StepPhase::kActive);
  EXPECT_EQ(fixture.status().revision, before + 2);
}

TEST(StateMachine, ATimeoutFailsTheTrainingOrSkipsTheState) {
  const std::string quick = test::with(test::smallScenario(), "for: 0.1 s", "for: 0.1 s\n    timeout: 0.2 s");
  test::ScenarioFixture fails(quick);
  fails.step(199);
  EXPECT_EQ(fails.status().phase, StepPhase::kActive);
  fails.step(1);
  EXPECT_EQ(fails.status().phase, StepPhase::kTimedOut);
  EXPECT_TRUE(fails.status().failed);
  fails.step(100);
  EXPECT_EQ(fails.status().step, 0U) << "a failed training stays in its state";

  test::ScenarioFixture skips(test::with(quick, "timeout: 0.2 s", "timeout: 0.2 s\n    on_timeout: skip"));
  skips.step(200);
  EXPECT_EQ(skips.status().phase, StepPhase::kTimedOut);
  skips.step(1);
  EXPECT_EQ(skips.status().step, 1U);
  EXPECT_FALSE(skips.status().failed);
}

TEST(StateMachine, WhereNoTimePassesCommandsActAndNothingElseDoes) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.moveTo(Vector3(0.2, 0, 0.129));
  ASSERT_EQ(fixture.status().step, 0U);
  const double seconds = fixture.status().contact_seconds;
  const std::vector<GameCommand> none;
  for (int i = 0; i < 2000; ++i) fixture.machine().step(fixture.environment(), none, 0);
  EXPECT_EQ(fixture.status().step, 0U) << "a touch of 0.1 s ends it";
  EXPECT_EQ(fixture.status().contact_seconds, seconds);
  const std::vector<GameCommand> skip{command(CommandKind::kSkipStep)};
  fixture.machine().step(fixture.environment(), skip, 0);
  EXPECT_EQ(fixture.status().phase, StepPhase::kSkipped);
}

TEST(StateMachine, SkippingAStateThatSnapsFixesThePartAtItsTarget) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.step({command(CommandKind::kSkipStep)});
  EXPECT_EQ(fixture.status().phase, StepPhase::kSkipped);
  fixture.step(10);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld);
  fixture.step({command(CommandKind::kSkipStep)});
  EXPECT_TRUE(fixture.status().finished);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kFixed);
  EXPECT_EQ(fixture.object("part").X_WO.translation(), Vector3(0, 0, -0.02));
}

TEST(StateMachine, TwoSkipsInOneTickSkipTwoStates) {
  test::ScenarioFixture fixture(test::smallScenario());
  std::vector<GameCommand> waiting(2, command(CommandKind::kSkipStep));
  for (int tick = 0; tick < 10; ++tick) {
    const std::size_t taken = fixture.machine().step(fixture.environment(), waiting);
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(taken));
    fixture.environment().step();
  }
  EXPECT_TRUE(waiting.empty());
  EXPECT_EQ(fixture.status().skipped, 2U);
  EXPECT_TRUE(fixture.status().finished);
}

TEST(StateMachine, ACommandBetweenTwoStatesIsForTheSecond) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.step({command(CommandKind::kSkipStep)});
  ASSERT_EQ(fixture.status().phase, StepPhase::kSkipped);
  const std::vector<GameCommand> skip{command(CommandKind::kSkipStep)};
  EXPECT_EQ(fixture.machine().step(fixture.environment(), skip), 0U);
  EXPECT_EQ(fixture.status().phase, StepPhase::kActive);
  EXPECT_EQ(fixture.machine().step(fixture.environment(), skip), 1U);
  EXPECT_EQ(fixture.status().skipped, 2U);
}

TEST(StateMachine, AReleasedPartIsGrabbedAgainByTouch) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.touchPart();
  fixture.step({command(CommandKind::kRelease)});
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked);
  EXPECT_EQ(fixture.object("pointer").status, ObjectStatus::kHeld);
  fixture.step(900);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked);
  fixture.step(200);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld);
}

TEST(StateMachine, EachHandGrabsAReleasedPartAgainByItsOwnTouch) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "hands: {right: part}", "hands: {right: part, instructor: part}"));
  fixture.touchPart();
  GameCommand of_instructor = command(CommandKind::kRelease);
  of_instructor.hand = HandId{1};
  fixture.step({command(CommandKind::kRelease), of_instructor});
  ASSERT_EQ(fixture.object("part").status, ObjectStatus::kParked);
  fixture.step(900);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked);
  fixture.step(200);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld)
      << "the instructor, who does not touch it, is of no concern";
}

TEST(StateMachine, ResetRestoresTheStart) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.touchPart();
  fixture.step({command(CommandKind::kReset)});
  EXPECT_EQ(fixture.status().step, 0U);
  EXPECT_EQ(fixture.status().phase, StepPhase::kActive);
  EXPECT_EQ(fixture.object("part").X_WO.translation(), Vector3(0.2, 0, 0.1));
  EXPECT_EQ(fixture.object("pointer").status, ObjectStatus::kHeld);
}

TEST(StateMachine, GoingBackUndoesWhatWasMounted) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.touchPart();
  fixture.insertPart();
  fixture.step(100);
  ASSERT_TRUE(fixture.status().finished);
  fixture.step({command(CommandKind::kBack)});
  EXPECT_EQ(fixture.status().step, 0U);
  EXPECT_EQ(fixture.status().phase, StepPhase::kActive);
  EXPECT_FALSE(fixture.status().finished);
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kParked);
  EXPECT_EQ(fixture.object("part").X_WO.translation(), Vector3(0.2, 0, 0.1));
}

TEST(StateMachine, GoingToAStepMakesTheSceneThatSkippingMakes) {
  test::ScenarioFixture skips(test::smallScenario());
  skips.step({command(CommandKind::kSkipStep)});
  skips.step(1);
  test::ScenarioFixture goes(test::smallScenario());
  goes.step({GameCommand{.kind = CommandKind::kGoToStep, .signal = 1}});
  goes.step(1);
  for (const char* name : {"part", "pointer"}) {
    EXPECT_EQ(goes.object(name).status, skips.object(name).status) << name;
    EXPECT_TRUE(goes.object(name).X_WO.translation().isApprox(skips.object(name).X_WO.translation(), 1e-6))
        << name;
  }
  EXPECT_EQ(goes.status().step, 1U);
  EXPECT_EQ(goes.status().skipped, 1U) << "it was passed over";
  goes.step({GameCommand{.kind = CommandKind::kGoToStep, .signal = 1000}});
  EXPECT_EQ(goes.status().step, 1U) << "there is no such step";
}

TEST(StateMachine, AFreeBodyIsPutToItsTargetByASkipAndByGoingPast) {
  std::string text = test::with(test::smallScenario(), "status: hidden,", "body: {mass: 250 g},");
  text = test::with(
      text, "    snap: true\n    timeout: 2 s\n",
      "    timeout: 2 s\n  - name: stands\n    hands: {right: pointer}\n    for: 1 s\n    touch: part\n");
  for (const CommandKind kind : {CommandKind::kSkipStep, CommandKind::kGoToStep}) {
    test::ScenarioFixture fixture(text);
    if (kind == CommandKind::kSkipStep) {
      fixture.step({command(kind)});
      fixture.step(10);
      ASSERT_EQ(fixture.object("part").status, ObjectStatus::kHeld);
      fixture.step({command(kind)});
    } else {
      fixture.step({GameCommand{.kind = kind, .signal = 2}});
    }
    fixture.step(1);
    EXPECT_EQ(fixture.status().step, 2U);
    EXPECT_EQ(fixture.object("part").status, ObjectStatus::kFree);
    EXPECT_LT((fixture.object("part").X_WO.translation() - Vector3(0, 0, -0.02)).norm(),
              1e-4)  // it falls from there
        << fixture.object("part").X_WO.translation().transpose();
  }
}

TEST(StateMachine, ARepeatedStepThatIsDoneIsNoLongerSkipped) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.step({command(CommandKind::kSkipStep)});
  EXPECT_EQ(fixture.status().skipped, 1U);
  fixture.step(1);
  fixture.step({command(CommandKind::kBack)});
  EXPECT_EQ(fixture.status().skipped, 0U);
  fixture.touchPart();
  EXPECT_EQ(fixture.status().step, 1U);
  EXPECT_EQ(fixture.status().skipped, 0U);
  const std::uint32_t revision = fixture.status().revision;
  fixture.step({command(CommandKind::kRepeatStep)});
  EXPECT_EQ(fixture.status().step, 1U);
  EXPECT_GT(fixture.status().revision, revision);
}

TEST(StateMachine, AnObjectIsHandedOver) {
  test::ScenarioFixture fixture(test::smallScenario());
  const ObjectId part = fixture.scenario().objectNamed("part");
  fixture.step({GameCommand{.kind = CommandKind::kHandOver, .hand = HandId{0}, .signal = part.value}});
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld);
  EXPECT_EQ(fixture.object("part").holder, HandId{0});
  fixture.step({GameCommand{.kind = CommandKind::kHandOver, .hand = HandId{77}, .signal = part.value}});
  fixture.step({GameCommand{.kind = CommandKind::kHandOver, .hand = HandId{0}, .signal = 1000}});
  EXPECT_EQ(fixture.object("part").status, ObjectStatus::kHeld);
}

TEST(StateMachine, PairsAreSwitchedByStatesAndByCommands) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "    snap: true", "    pairs_off: [[part, cube]]\n    snap: true"));
  const auto pair = static_cast<std::uint32_t>(fixture.scenario().pairOf(ObjectId{1}, ObjectId{3}));
  EXPECT_TRUE(fixture.environment().pairs()[pair].enabled);
  fixture.step({command(CommandKind::kSkipStep)});
  fixture.step(1);
  EXPECT_FALSE(fixture.environment().pairs()[pair].enabled);
  fixture.step({GameCommand{.kind = CommandKind::kSetCollision, .signal = pair, .value = 1.0}});
  EXPECT_TRUE(fixture.environment().pairs()[pair].enabled);
  fixture.step({GameCommand{.kind = CommandKind::kSetCollision, .signal = 1000, .value = 1.0}});
}

//   part ->  [cube]      a part passes through objects of its group, and collides with them after leaving it
TEST(StateMachine, StatesPutObjectsIntoGroupsAndRemoveThem) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "    snap: true\n    timeout: 2 s\n",
                 "    groups: {part: kit, cube: kit}\n  - name: leave\n    groups: {part: none}\n"));
  const ObjectId part = fixture.scenario().objectNamed("part");
  const ObjectId cube = fixture.scenario().objectNamed("cube");
  const simulation::Environment& environment = fixture.environment();
  fixture.touchPart();
  ASSERT_EQ(fixture.status().step, 1U);
  EXPECT_EQ(environment.groupOf(part), 1U);
  EXPECT_EQ(environment.groupOf(cube), 1U);

  const Vector3 p_PH = -environment.hands()[0].X_HO.translation();
  const auto apart = [&] {
    return (fixture.object("part").X_WO.translation() - fixture.object("cube").X_WO.translation()).x();
  };
  fixture.moveTo(Vector3(-0.2, 0, 0.2) + p_PH);
  fixture.moveTo(Vector3(-0.28, 0, 0.2) + p_PH);
  EXPECT_FALSE(environment.inContact(part, cube));
  EXPECT_NEAR(apart(), 0.02, 1e-4) << "half of each inside the other";

  fixture.moveTo(Vector3(-0.2, 0, 0.2) + p_PH);
  fixture.step({command(CommandKind::kSkipStep)});
  fixture.step(1);
  EXPECT_EQ(environment.groupOf(part), 0U);
  EXPECT_EQ(environment.groupOf(cube), 1U);
  fixture.moveTo(Vector3(-0.28, 0, 0.2) + p_PH);
  EXPECT_TRUE(environment.inContact(part, cube));
  EXPECT_GT(apart(), 0.0395);

  fixture.step({command(CommandKind::kReset)});
  EXPECT_EQ(environment.groupOf(cube), 0U) << "as at the start";
}

TEST(StateMachine, OverlappingObjectsCollideAsSoonAsTheirGroupEnds) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "    snap: true\n    timeout: 2 s\n",
                 "    groups: {part: kit, cube: kit}\n  - name: leave\n    groups: {cube: none}\n"));
  const ObjectId part = fixture.scenario().objectNamed("part");
  const ObjectId cube = fixture.scenario().objectNamed("cube");
  fixture.touchPart();
  const Vector3 p_PH = -fixture.environment().hands()[0].X_HO.translation();
  fixture.moveTo(Vector3(-0.262, 0, 0.2) + p_PH);
  EXPECT_FALSE(fixture.environment().inContact(part, cube));
  fixture.step({command(CommandKind::kSkipStep)});
  fixture.step(1);
  EXPECT_TRUE(fixture.environment().inContact(part, cube));
}

TEST(StateMachine, RolesFollowTheOwnObjectsOfSwappedHands) {
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "role: instructor, object: cube", "object: cube"));
  fixture.environment().setHandPresent(HandId{1}, true);
  fixture.environment().setHandPose(HandId{1}, Pose(Vector3(0.2, 0.3, 0.3)), Twist{});
  const std::uint32_t before = fixture.status().revision;
  fixture.step({command(CommandKind::kSwapHands)});
  EXPECT_EQ(fixture.status().hand, HandId{1}) << "the hand whose default object is the pointer";
  EXPECT_GT(fixture.status().revision, before);
  fixture.step({command(CommandKind::kSkipStep)});
  fixture.step(2);
  EXPECT_EQ(fixture.environment().hands()[1].object, fixture.scenario().objectNamed("part"));
}

TEST(StateMachine, DescribesTheStateAndItsProgress) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.touchPart();
  const StepState step = describe(fixture.scenario(), fixture.status());
  EXPECT_EQ(step.name, "mount");
  EXPECT_EQ(step.steps, 2U);
  EXPECT_TRUE(step.has_target);
  EXPECT_EQ(step.approach_W, Vector3(0, 0, -1));
  EXPECT_DOUBLE_EQ(step.timeout, 2.0);
  EXPECT_EQ(step.hand, HandId{0});
  const StepProgress report = progress(fixture.scenario(), fixture.status(), 7);
  EXPECT_EQ(report.tick, 7U);
  ASSERT_EQ(report.conditions.size(), 1U);
  EXPECT_EQ(report.conditions[0].text, "pose of part");
  EXPECT_FLOAT_EQ(report.conditions[0].value, static_cast<float>(report.position_error));
  EXPECT_FLOAT_EQ(report.conditions[0].limit, 0.002F);
  EXPECT_EQ(report.nodes, 1U);
  EXPECT_EQ(report.conditions[0].depth, 0U);
}

TEST(StateMachine, ProgressTellsTheConditionTree) {
  const std::string conditions =
      "    touch: part\n    conditions:\n      - any:\n          - {signal: bell}\n          - all:\n"
      "              - {command: fulfilled}\n              - {signal: whistle}\n      - {command: "
      "fulfilled}\n";
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "    touch: part\n    for: 0.1 s\n", conditions));
  const StepProgress before = progress(fixture.scenario(), fixture.status(), 0);
  EXPECT_EQ(before.nodes, 6U) << "told from the start of the step";
  fixture.step();
  const StepProgress evaluated = progress(fixture.scenario(), fixture.status(), 1);
  for (std::size_t i = 0; i < before.conditions.size(); ++i)
    EXPECT_FLOAT_EQ(before.conditions[i].limit, evaluated.conditions[i].limit)
        << before.conditions[i].text << ": its limit is known before it is evaluated, as under a stop";
  fixture.step({command(CommandKind::kFulfilled)});
  const StepProgress report = progress(fixture.scenario(), fixture.status(), 1);
  struct Row {
    std::string text;
    int depth;
    ConditionGroup group;
    float value, limit;
    bool met;
    bool operator==(const Row&) const = default;
  };
  std::vector<Row> rows;
  for (const ConditionValue& c : report.conditions)
    rows.push_back({c.text, c.depth, c.group, c.value, c.limit, c.met});
  const auto kSingle = ConditionGroup::kSingle;
  EXPECT_EQ(report.nodes, 6U) << "a root that asks for all is not told";
  EXPECT_EQ(rows, (std::vector<Row>{{"any", 0, ConditionGroup::kAny, 0, 1, false},
                                    {"signal bell", 1, kSingle, 0, 1, false},
                                    {"all", 1, ConditionGroup::kAll, 1, 2, false},
                                    {"command fulfilled", 2, kSingle, 1, 1, true},
                                    {"signal whistle", 2, kSingle, 0, 1, false},
                                    {"command fulfilled", 0, kSingle, 1, 1, true}}));
}

TEST(StateMachine, ProgressCountsTheNodesThatItDoesNotTell) {
  std::string conditions = "    touch: part\n    conditions:\n";
  for (int i = 0; i < 20; ++i) conditions += "      - {signal: s" + std::to_string(i) + "}\n";
  test::ScenarioFixture fixture(
      test::with(test::smallScenario(), "    touch: part\n    for: 0.1 s\n", conditions));
  fixture.step();
  const StepProgress report = progress(fixture.scenario(), fixture.status(), 1);
  EXPECT_EQ(report.nodes, 20U);
  EXPECT_EQ(report.conditions.size(), kMostConditionsTold);
}

TEST(StateMachine, TheSameHandMotionGivesTheSameHash) {
  std::vector<std::uint64_t> hashes;
  for (int run = 0; run < 2; ++run) {
    test::ScenarioFixture fixture(test::smallScenario());
    fixture.touchPart();
    fixture.insertPart();
    hashes.push_back(fixture.hash());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(StateMachine, ContinuesFromASavedState) {
  test::ScenarioFixture one(test::smallScenario());
  test::ScenarioFixture other(test::smallScenario());
  one.moveTo(Vector3(0.2, 0, 0.129));
  one.step(50);
  ASSERT_TRUE(other.environment().restore(one.environment().save()));
  ASSERT_TRUE(other.machine().restore(one.machine().save()));
  EXPECT_EQ(one.hash(), other.hash());
  for (test::ScenarioFixture* fixture : {&one, &other}) {
    fixture->step(80);
    fixture->insertPart();
  }
  EXPECT_EQ(one.hash(), other.hash());
  EXPECT_EQ(one.status().step, 1U);
}

TEST(StateMachine, RefusesAnInvalidSavedState) {
  test::ScenarioFixture fixture(test::smallScenario());
  EXPECT_FALSE(fixture.machine().restore(std::vector<std::uint8_t>(7)));
  const std::vector<std::uint8_t> good = fixture.machine().save();
  std::vector<std::uint8_t> bytes = good;
  bytes[8] = 77;
  const auto restored = fixture.machine().restore(bytes);
  ASSERT_FALSE(restored);
  EXPECT_NE(restored.error().what.find("step 77"), std::string::npos) << restored.error().what;
  bytes = good;
  bytes[12 * sizeof(std::uint64_t)] = 1U << 5U;
  const auto skipped = fixture.machine().restore(bytes);
  ASSERT_FALSE(skipped);
  EXPECT_NE(skipped.error().what.find("outcome of step 5, but the scenario has 2"), std::string::npos)
      << skipped.error().what;
}

TEST(StateMachine, RefusesASavedStateWithANumberThatIsNotFinite) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.step(10);
  const std::vector<std::uint8_t> good = fixture.machine().save();
  const std::vector<std::size_t> doubles = fixture.machine().savedDoubles();
  ASSERT_EQ(doubles.size(), 3 + 2 * kMaxConditions)
      << "errors and time of the step, a reading for each condition";
  for (const std::size_t at : doubles) {
    for (const double number : {std::nan(""), -std::numeric_limits<double>::infinity()}) {
      std::vector<std::uint8_t> bad = good;
      std::memcpy(bad.data() + at, &number, sizeof number);
      ASSERT_FALSE(fixture.machine().restore(bad)) << number << " at byte " << at;
    }
  }
  EXPECT_TRUE(fixture.machine().restore(good));
}

TEST(StateMachine, StepAllocatesNothingAndLocksNothing) {
  test::ScenarioFixture fixture(test::smallScenario());
  fixture.step(10);
  const std::vector<GameCommand> skip{command(CommandKind::kSkipStep)};
  const test::RealtimeGuard guard;
  for (int i = 0; i < 1000; ++i) fixture.machine().step(fixture.environment(), {});
  fixture.machine().step(fixture.environment(), skip);
  for (int i = 0; i < 100; ++i) fixture.machine().step(fixture.environment(), {});
  fixture.machine().step(fixture.environment(), skip);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_TRUE(fixture.status().finished);
}

}  // namespace
}  // namespace tenon::game_control
