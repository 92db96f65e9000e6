#include "server/session/exercise.h"

#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

using test::kLeftHand;
using test::kRightHand;
using test::kTeacherHand;
using test::play;
using test::Stage;

const Vector3 kAside(0.2, 0, 0.3);

Change game(CommandKind kind) { return {.kind = ChangeKind::kGame, .game = {.kind = kind}}; }

TEST(Exercise, WaitsForTheHandsItNeeds) {
  Stage stage(1, {kRightHand, kLeftHand});
  EXPECT_EQ(stage.tick(10).phase, RunPhase::kWaitingForPeople);
  stage.attach(kRightHand, kAside);
  EXPECT_EQ(stage.tick(10).phase, RunPhase::kWaitingForPeople);
  EXPECT_EQ(stage.output().step.phase, StepPhase::kWaiting);
  stage.change({.kind = ChangeKind::kAttach, .hand = kLeftHand});
  EXPECT_EQ(stage.tick(10).phase, RunPhase::kWaitingForPeople) << "somebody, but no reading yet";
  stage.reading(kLeftHand).X_WH = Pose(Vector3(0.5, 0, 0.3));
  EXPECT_EQ(stage.tick().phase, RunPhase::kRunning);
  EXPECT_EQ(stage.output().step.phase, StepPhase::kActive);
  EXPECT_EQ(stage.object("part").status, ObjectStatus::kParked) << "the first state has begun";
}

TEST(Exercise, NeedsNobodyWhenNobodyIsNamed) {
  Stage stage;
  EXPECT_EQ(stage.tick().phase, RunPhase::kRunning);
}

TEST(Exercise, AHandThatFallsSilentIsHeldStillThenParkedAndComesBack) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.tick(5);
  EXPECT_EQ(stage.object("pointer").status, ObjectStatus::kHeld);
  stage.silence(kRightHand);
  stage.tick(50);
  EXPECT_FALSE(stage.hand(kRightHand).frozen) << "a lost sample is no reason";
  EXPECT_EQ(stage.output().ages[0], 50U);
  stage.tick();
  EXPECT_TRUE(stage.hand(kRightHand).frozen);
  EXPECT_TRUE(stage.output().manifolds[0].frozen) << "and its client is told";
  stage.tick(948);
  EXPECT_TRUE(stage.hand(kRightHand).present);
  stage.tick();
  EXPECT_FALSE(stage.hand(kRightHand).present);
  EXPECT_FALSE(stage.output().present[0]);
  EXPECT_EQ(stage.object("pointer").status, ObjectStatus::kParked);

  const std::uint32_t epoch = stage.object("pointer").epoch;
  stage.reading(kRightHand).X_WH = Pose(Vector3(0.3, 0, 0.3));
  stage.tick(2);
  EXPECT_TRUE(stage.hand(kRightHand).present);
  EXPECT_FALSE(stage.hand(kRightHand).frozen);
  EXPECT_EQ(stage.object("pointer").status, ObjectStatus::kHeld);
  EXPECT_GT(stage.object("pointer").epoch, epoch) << "declared: displays do not smear the jump";
  EXPECT_NEAR(stage.object("pointer").X_WO.translation().x(), 0.3, 1e-3);
}

TEST(Exercise, ADetachedHandIsGoneAtOnceAndItsReadingsCountNoMore) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.tick(5);
  stage.change({.kind = ChangeKind::kDetach, .hand = kRightHand});
  stage.tick();
  EXPECT_FALSE(stage.hand(kRightHand).present);
  EXPECT_EQ(stage.object("pointer").status, ObjectStatus::kParked);
  stage.tick(3);
  EXPECT_FALSE(stage.hand(kRightHand).present);
}

TEST(Exercise, AStationThatHoldsItsDeviceStillHoldsItsObjectStill) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.tick(5);
  stage.reading(kRightHand).active = false;
  stage.move(kRightHand, Vector3(0.2, 0, 0.4));
  const Vector3 p_WO = stage.object("pointer").X_WO.translation();
  stage.tick(20);
  EXPECT_TRUE(stage.hand(kRightHand).frozen);
  EXPECT_EQ(stage.object("pointer").X_WO.translation(), p_WO);
}

TEST(Exercise, AnEmergencyStopHoldsEverybodyStillUntilItIsCleared) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.attach(kTeacherHand, Vector3(-0.3, 0, 0.3));
  stage.tick(5);
  stage.change({.kind = ChangeKind::kHalt, .value = 1.0});
  stage.tick();
  const Vector3 p_WO = stage.object("pointer").X_WO.translation();
  const Vector3 p_WC = stage.object("cube").X_WO.translation();
  stage.move(kRightHand, Vector3(0.2, 0, 0.4));
  stage.move(kTeacherHand, Vector3(-0.3, 0, 0.4));
  stage.change(game(CommandKind::kSkipStep));
  stage.tick(100);
  EXPECT_TRUE(stage.output().emergency_stop);
  EXPECT_TRUE(stage.output().manifolds[0].frozen);
  EXPECT_TRUE(stage.output().manifolds[1].frozen);
  EXPECT_EQ(stage.object("pointer").X_WO.translation(), p_WO);
  EXPECT_EQ(stage.object("cube").X_WO.translation(), p_WC);
  EXPECT_EQ(stage.output().step.step, 0U);
  stage.change({.kind = ChangeKind::kHalt, .value = 0.0});
  stage.tick(300);
  EXPECT_FALSE(stage.output().emergency_stop);
  EXPECT_FALSE(stage.hand(kRightHand).frozen);
  EXPECT_NEAR(stage.object("cube").X_WO.translation().z(), 0.4, 1e-3);
  EXPECT_EQ(stage.output().step.step, 1U) << "what was commanded meanwhile is done now";
}

TEST(Exercise, APauseStopsHandsAndTheClockOfAState) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.tick();
  stage.change(game(CommandKind::kSkipStep));
  stage.tick(2);
  ASSERT_EQ(stage.output().step.step, 1U) << "which may last 2 s";
  stage.change({.kind = ChangeKind::kPause});
  EXPECT_EQ(stage.tick(3000).phase, RunPhase::kPaused);
  EXPECT_TRUE(stage.hand(kRightHand).frozen);
  stage.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(stage.tick(1900).phase, RunPhase::kRunning);
  EXPECT_FALSE(stage.hand(kRightHand).frozen);
  EXPECT_EQ(stage.tick(200).phase, RunPhase::kFailed) << "only time that passed for the trainee counts";
  EXPECT_TRUE(stage.exercise().over());
}

TEST(Exercise, APausedExerciseAndAStoppedOneDoNotBecomeAnother) {
  Stage stage;
  stage.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(stage.tick().phase, RunPhase::kRunning);
  stage.change({.kind = ChangeKind::kStop});
  EXPECT_EQ(stage.tick().phase, RunPhase::kStopped);
  stage.change({.kind = ChangeKind::kPause});
  stage.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(stage.tick().phase, RunPhase::kStopped);
}

TEST(Exercise, SwappedHandsMoveEachOthersObjectsAndTheStepSaysSo) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.attach(kLeftHand, Vector3(0.5, 0, 0.3));
  stage.tick(5);
  ASSERT_EQ(stage.output().step.hand, kRightHand);
  const std::uint32_t revision = stage.output().step.revision;
  stage.change(game(CommandKind::kSwapHands));
  stage.tick(2);
  EXPECT_EQ(stage.object("pointer").holder, kLeftHand);
  EXPECT_EQ(stage.object("spare").holder, kRightHand);
  EXPECT_NEAR(stage.object("pointer").X_WO.translation().x(), 0.5, 1e-3);
  EXPECT_EQ(stage.output().step.hand, kLeftHand) << "the hand that has the pointer is asked";
  EXPECT_GT(stage.output().step.revision, revision);
}

TEST(Exercise, WhatPointsNowhereIsPassedOver) {
  Stage stage;
  stage.attach(kRightHand, kAside);
  stage.tick();
  const HandId no_hand{99};
  const ObjectId no_object{99};
  for (int kind = 0; kind <= static_cast<int>(ChangeKind::kPlace); ++kind)
    stage.change(
        {.kind = static_cast<ChangeKind>(kind), .hand = no_hand, .object = no_object, .index = 9999});
  stage.reading(no_hand);
  stage.tick();
  EXPECT_EQ(stage.object("pointer").status, ObjectStatus::kHeld);
}

std::vector<std::uint64_t> hashesOfThePlay(unsigned workers) {
  const LoadedScene loaded = test::smallSession();
  Exercise exercise = Stage::makeExercise(loaded, workers, {kRightHand});
  std::vector<std::uint64_t> hashes;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    exercise.tick(play(tick));
    hashes.push_back(exercise.hash());
  }
  EXPECT_EQ(exercise.phase(), RunPhase::kSucceeded) << "the play must be one that does something";
  return hashes;
}

TEST(Exercise, BudgetsComeAsInputs) {
  Stage stage;
  stage.change({.kind = ChangeKind::kBudget, .value = 3000.0});
  stage.tick();
  const Environment& environment = stage.exercise().environment();
  EXPECT_EQ(environment.workLimits().points, 3000U);
  stage.change({.kind = ChangeKind::kBudget, .value = -std::numeric_limits<double>::quiet_NaN()});
  stage.tick();
  EXPECT_EQ(environment.workLimits().points, 0U) << "what is no number is no limit";
}

TEST(Exercise, EqualInputsGiveEqualHashesForAnyNumberOfWorkers) {
  const auto hashes = hashesOfThePlay(1);
  EXPECT_EQ(hashes, hashesOfThePlay(1));
  EXPECT_EQ(hashes, hashesOfThePlay(2));
}

TEST(Exercise, GoesOnFromASavedStateToEqualHashes) {
  const LoadedScene loaded = test::smallSession();
  Exercise exercise = Stage::makeExercise(loaded, 1, {kRightHand});
  std::vector<std::vector<std::uint8_t>> saved;
  std::vector<std::uint64_t> hashes;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    exercise.tick(play(tick));
    hashes.push_back(exercise.hash());
    if (tick % 300 == 0) exercise.save(saved.emplace_back());
  }
  for (std::size_t i = 0; i < saved.size(); ++i) {
    Exercise again = Stage::makeExercise(loaded);
    const auto restored = again.restore(saved[i]);
    ASSERT_TRUE(restored) << restored.error().what;
    ASSERT_EQ(again.now(), 300 * (i + 1));
    ASSERT_EQ(again.hash(), hashes[again.now() - 1]);
    for (Tick tick = again.now() + 1; tick <= 300 * (i + 2) && tick <= test::kPlayTicks; ++tick) {
      again.tick(play(tick));
      ASSERT_EQ(again.hash(), hashes[tick - 1]) << "tick " << tick << " after a save at " << 300 * (i + 1);
    }
  }
}

TEST(Exercise, KeepsWhatWasCommandedWhilePausedInASave) {
  Stage stage;
  stage.change({.kind = ChangeKind::kPause});
  stage.tick();
  stage.change({.kind = ChangeKind::kPause});
  stage.change(game(CommandKind::kSkipStep));
  stage.tick();  // running since the first tick, paused since the second
  ASSERT_EQ(stage.output().phase, RunPhase::kPaused);
  std::vector<std::uint8_t> saved;
  stage.exercise().save(saved);
  Exercise again = Stage::makeExercise(stage.loaded());
  ASSERT_TRUE(again.restore(saved));
  EXPECT_EQ(again.hash(), stage.exercise().hash());
  TickInput resume{.tick = 3};
  resume.changes.push_back({.kind = ChangeKind::kResume});
  again.tick(resume);
  EXPECT_EQ(again.step().phase, StepPhase::kSkipped);
}

TEST(Exercise, RefusesASaveThatIsCutOrOfAnotherScenario) {
  Stage stage(1, {kRightHand});
  stage.tick(3);
  std::vector<std::uint8_t> saved;
  stage.exercise().save(saved);
  Exercise again = Stage::makeExercise(stage.loaded());
  for (std::size_t size = 0; size < saved.size(); size += 7)
    ASSERT_FALSE(again.restore(std::span(saved).first(size))) << size << " of " << saved.size();
  Exercise other = Stage::makeExercise(test::smallSession(test::smallScenario()));
  const auto restored = other.restore(saved);
  ASSERT_FALSE(restored);
  EXPECT_FALSE(restored.error().what.empty());
  ASSERT_TRUE(again.restore(saved)) << "a failure leaves nothing behind";
  EXPECT_EQ(again.hash(), stage.exercise().hash());
}

TEST(Exercise, ATickAllocatesNothingAndLocksNothing) {
  if (!test::RealtimeGuard::available()) GTEST_SKIP() << "a sanitizer counts allocations itself";
  const LoadedScene loaded = test::smallSession();
  Exercise exercise = Stage::makeExercise(loaded, 1, {kRightHand});
  TickOutput output = exercise.makeOutput();
  exercise.tick(play(1));  // warm-up
  exercise.fill(output);
  std::int64_t allocations = 0;
  std::int64_t locks = 0;
  for (Tick tick = 2; tick <= test::kPlayTicks; ++tick) {
    const TickInput input = play(tick);
    const test::RealtimeGuard guard;
    exercise.tick(input);
    exercise.fill(output);
    allocations += guard.allocations();
    locks += guard.locks();
  }
  EXPECT_EQ(exercise.phase(), RunPhase::kSucceeded);
  EXPECT_EQ(allocations, 0);
  EXPECT_EQ(locks, 0);
}

}  // namespace
}  // namespace tenon
