#include "server/session/session_simulation.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/session/small_session.h"
#include "tests/support/realtime_guard.h"

namespace tenon::session {
namespace {

using test::kInstructorHand;
using test::kLeftHand;
using test::kRightHand;
using test::playInput;
using test::SessionRig;

const Vector3 kFreeSpace(0.2, 0, 0.3);

Change game(CommandKind kind) { return {.kind = ChangeKind::kGameCommand, .game = {.kind = kind}}; }

TEST(SessionSimulation, WaitsForTheNeededHands) {
  test::SessionRig rig(1, {test::kRightHand, test::kLeftHand});
  EXPECT_EQ(rig.tick(10).phase, RunPhase::kWaitingForPeople);
  rig.attach(test::kRightHand, kFreeSpace);
  EXPECT_EQ(rig.tick(10).phase, RunPhase::kWaitingForPeople);
  EXPECT_EQ(rig.output().step.phase, StepPhase::kWaiting);
  rig.change({.kind = ChangeKind::kAttach, .hand = test::kLeftHand});
  EXPECT_EQ(rig.tick(10).phase, RunPhase::kWaitingForPeople) << "attached, but no sample yet";
  rig.reading(test::kLeftHand).X_WH = Pose(Vector3(0.5, 0, 0.3));
  EXPECT_EQ(rig.tick().phase, RunPhase::kRunning);
  EXPECT_EQ(rig.output().step.phase, StepPhase::kActive);
  EXPECT_EQ(rig.object("part").status, ObjectStatus::kParked) << "the first state has started";
}

TEST(SessionSimulation, StartsInTheFirstTickWithoutNeededHands) {
  test::SessionRig rig;
  EXPECT_EQ(rig.tick().phase, RunPhase::kRunning);
}

TEST(SessionSimulation, AHandWithoutInputIsFrozenThenParkedAndReturns) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kHeld);
  rig.loseLink(test::kRightHand);
  rig.tick(50);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen) << "a few lost samples do not freeze it";
  EXPECT_EQ(rig.output().ages[0], 50U);
  rig.tick();
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  EXPECT_TRUE(rig.output().manifolds[0].frozen) << "and its manifold says so";
  rig.tick(948);
  EXPECT_TRUE(rig.hand(test::kRightHand).present);
  rig.tick();
  EXPECT_FALSE(rig.hand(test::kRightHand).present);
  EXPECT_FALSE(rig.output().present[0]);
  EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kParked);

  const std::uint32_t epoch = rig.object("pointer").epoch;
  rig.reading(test::kRightHand).X_WH = Pose(Vector3(0.3, 0, 0.3));
  rig.tick(2);
  EXPECT_TRUE(rig.hand(test::kRightHand).present);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen);
  EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kHeld);
  EXPECT_GT(rig.object("pointer").epoch, epoch) << "displays must not interpolate over the jump";
  EXPECT_NEAR(rig.object("pointer").X_WO.translation().x(), 0.3, 1e-3);
}

TEST(SessionSimulation, AHandWhoseInputsDoNotComeIsToldToOthersToStand) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.attach(test::kLeftHand, kFreeSpace + Vector3(0.06, 0.0, 0.0));
  rig.reading(test::kLeftHand).V_WH.linear.x() = 0.1;
  rig.tick(5);
  const auto told = [&] {
    const auto& others = rig.output().manifolds[test::kRightHand.value].others;
    return others.size() == 1 && others[0].hand == test::kLeftHand ? others[0].V_WG[0] : -1.0F;
  };
  EXPECT_FLOAT_EQ(told(), 0.1F);
  rig.loseLink(test::kLeftHand);
  rig.tick(kMostInputPeriod);
  EXPECT_FLOAT_EQ(told(), 0.1F) << "some may be lost";
  rig.tick();
  EXPECT_EQ(told(), 0.0F);
  EXPECT_FALSE(rig.hand(test::kLeftHand).frozen);
  rig.reading(test::kLeftHand) = {.hand = test::kLeftHand,
                                  .X_WH = Pose(kFreeSpace + Vector3(0.06, 0.0, 0.0)),
                                  .V_WH = {Vector3(0.05, 0.0, 0.0), Vector3::Zero()}};
  rig.tick();
  EXPECT_FLOAT_EQ(told(), 0.05F);
}

Change limitsOf(HandId hand, std::uint32_t freeze, std::uint32_t park) {
  return {.kind = ChangeKind::kSetLimits, .hand = hand, .index = freeze, .lifetime_ticks = park};
}

TEST(SessionSimulation, AHandOfAWorseLinkFreezesAndParksLater) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  rig.change(limitsOf(test::kRightHand, 90, 1400));
  rig.tick();
  rig.loseLink(test::kRightHand);
  rig.tick(90);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen);
  rig.tick();
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  rig.tick(1400 - 92);
  EXPECT_TRUE(rig.hand(test::kRightHand).present);
  rig.tick();
  EXPECT_FALSE(rig.hand(test::kRightHand).present);
}

TEST(SessionSimulation, NoHandGoesOnForLongerThanTheBoundAndALimitThatShrinksActsAtOnce) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  rig.change(limitsOf(test::kRightHand, 1'000'000, 1'000'000));
  rig.tick();
  rig.loseLink(test::kRightHand);
  rig.tick(kMostFreezeTicks + 1);
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  rig.tick(kParkTicks);
  EXPECT_TRUE(rig.hand(test::kRightHand).present);
  rig.change(limitsOf(test::kRightHand, 0, 0));
  rig.tick();
  EXPECT_FALSE(rig.hand(test::kRightHand).present) << "it is beyond the limit of a link without faults";
}

TEST(SessionSimulation, LimitsAreOfTheClientThatAskedForThem) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.change(limitsOf(test::kRightHand, 90, 1400));
  rig.tick();
  rig.change({.kind = ChangeKind::kDetach, .hand = test::kRightHand});
  rig.tick();
  rig.change({.kind = ChangeKind::kAttach, .hand = test::kRightHand});
  rig.tick();
  rig.loseLink(test::kRightHand);
  rig.tick(kFreezeTicks + 1);
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
}

TEST(SessionSimulation, LimitsAreInTheHashAndInCheckpoints) {
  test::SessionRig rig, other;
  for (test::SessionRig* one : {&rig, &other}) {
    one->attach(test::kRightHand, kFreeSpace);
    one->tick(5);
  }
  EXPECT_EQ(rig.simulation().hash(), other.simulation().hash());
  rig.change(limitsOf(test::kRightHand, 90, 1400));
  rig.tick();
  other.tick();
  EXPECT_NE(rig.simulation().hash(), other.simulation().hash());
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);
  ASSERT_TRUE(other.simulation().restore(saved));
  EXPECT_EQ(rig.simulation().hash(), other.simulation().hash());
  for (test::SessionRig* one : {&rig, &other}) {
    one->loseLink(test::kRightHand);
    one->tick(80);
    EXPECT_FALSE(one->hand(test::kRightHand).frozen);
  }
  EXPECT_EQ(rig.simulation().hash(), other.simulation().hash());
}

TEST(SessionSimulation, ARoundTripIsInTheHashAndInCheckpointsUntilTheClientLeaves) {
  test::SessionRig rig, other;
  for (test::SessionRig* one : {&rig, &other}) {
    one->attach(test::kRightHand, kFreeSpace);
    one->tick(5);
  }
  Change change = limitsOf(test::kRightHand, kFreezeTicks, kParkTicks);
  change.value = 0.05;
  rig.change(change);
  rig.tick();
  other.tick();
  EXPECT_EQ(rig.hand(test::kRightHand).round_trip, 0.05);
  EXPECT_NE(rig.simulation().hash(), other.simulation().hash());
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);
  ASSERT_TRUE(other.simulation().restore(saved));
  EXPECT_EQ(other.hand(test::kRightHand).round_trip, 0.05);
  EXPECT_EQ(rig.simulation().hash(), other.simulation().hash());
  rig.change({.kind = ChangeKind::kDetach, .hand = test::kRightHand});
  rig.tick();
  rig.change({.kind = ChangeKind::kAttach, .hand = test::kRightHand});
  rig.tick();
  EXPECT_EQ(rig.hand(test::kRightHand).round_trip, 0.0);
}

TEST(SessionSimulation, ADetachedHandIsAbsentAtOnceAndItsSamplesAreIgnored) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  rig.change({.kind = ChangeKind::kDetach, .hand = test::kRightHand});
  rig.tick();
  EXPECT_FALSE(rig.hand(test::kRightHand).present);
  EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kParked);
  rig.tick(3);
  EXPECT_FALSE(rig.hand(test::kRightHand).present);
}

TEST(SessionSimulation, AnInactiveDeviceFreezesItsObject) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  rig.reading(test::kRightHand).active = false;
  rig.move(test::kRightHand, Vector3(0.2, 0, 0.4));
  const Vector3 p_WO = rig.object("pointer").X_WO.translation();
  rig.tick(20);
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  EXPECT_EQ(rig.object("pointer").X_WO.translation(), p_WO);
}

TEST(SessionSimulation, AnEmergencyStopFreezesAllHandsUntilItIsCleared) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.attach(test::kInstructorHand, Vector3(-0.3, 0, 0.3));
  rig.tick(5);
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 1.0});
  rig.tick();
  const Vector3 p_WO = rig.object("pointer").X_WO.translation();
  const Vector3 p_WC = rig.object("cube").X_WO.translation();
  rig.move(test::kRightHand, Vector3(0.2, 0, 0.4));
  rig.move(test::kInstructorHand, Vector3(-0.3, 0, 0.4));
  rig.change(game(CommandKind::kSkipStep));
  rig.tick(100);
  EXPECT_TRUE(rig.output().emergency_stop);
  EXPECT_TRUE(rig.output().manifolds[0].frozen);
  EXPECT_TRUE(rig.output().manifolds[1].frozen);
  EXPECT_EQ(rig.object("pointer").X_WO.translation(), p_WO);
  EXPECT_EQ(rig.object("cube").X_WO.translation(), p_WC);
  EXPECT_EQ(rig.output().step.step, 0U);
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 0.0});
  rig.tick(300);
  EXPECT_FALSE(rig.output().emergency_stop);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen);
  EXPECT_NEAR(rig.object("cube").X_WO.translation().z(), 0.4, 1e-3);
  EXPECT_EQ(rig.output().step.step, 0U) << "a command received meanwhile is dropped";
}

TEST(SessionSimulation, FrozenForcesHoldHandsStillWhileStepsGoOn) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.attach(test::kInstructorHand, Vector3(-0.3, 0, 0.3));
  rig.tick(5);
  const std::uint64_t before = rig.simulation().hash();
  rig.change({.kind = ChangeKind::kFreezeForces, .value = 1.0});
  rig.tick();
  EXPECT_NE(rig.simulation().hash(), before) << "it is part of the state";
  const Vector3 p_WC = rig.object("cube").X_WO.translation();
  rig.move(test::kInstructorHand, Vector3(-0.3, 0, 0.4));
  rig.change(game(CommandKind::kSkipStep));
  rig.tick(10);
  EXPECT_EQ(rig.output().phase, RunPhase::kRunning);
  EXPECT_TRUE(rig.output().forces_frozen);
  for (const HandManifold& manifold : {rig.output().manifolds[0], rig.output().manifolds[1]})
    EXPECT_TRUE(manifold.frozen) << "no station displays a force of it";
  EXPECT_EQ(rig.object("cube").X_WO.translation(), p_WC);
  EXPECT_EQ(rig.output().step.step, 1U);

  std::vector<std::uint8_t> bytes;
  rig.simulation().save(bytes);
  test::SessionRig other;
  ASSERT_TRUE(other.simulation().restore(bytes));
  EXPECT_EQ(other.simulation().hash(), rig.simulation().hash());

  rig.change({.kind = ChangeKind::kFreezeForces, .value = 0.0});
  rig.tick(300);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen);
  EXPECT_NEAR(rig.object("cube").X_WO.translation().z(), 0.4, 1e-3);
}

/// Paused in a step whose timeout is 2 s.
void pauseInATimedStep(test::SessionRig& rig) {
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick();
  rig.change(game(CommandKind::kSkipStep));
  rig.tick(2);
  ASSERT_EQ(rig.output().step.step, 1U);
  rig.change({.kind = ChangeKind::kPause});
}

TEST(SessionSimulation, APauseFreezesHandsAndSuspendsTimeouts) {
  test::SessionRig rig;
  pauseInATimedStep(rig);
  EXPECT_EQ(rig.tick(3000).phase, RunPhase::kPaused);
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  rig.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(rig.tick(1900).phase, RunPhase::kRunning);
  EXPECT_FALSE(rig.hand(test::kRightHand).frozen);
  EXPECT_EQ(rig.tick(200).phase, RunPhase::kFailed) << "time in a pause does not count";
  EXPECT_TRUE(rig.simulation().over());
}

TEST(SessionSimulation, NoTimeOfAStepPassesWithTheCommandsOfAPause) {
  test::SessionRig rig;
  pauseInATimedStep(rig);
  rig.tick();
  const auto pairOn = [] {
    Change change = game(CommandKind::kSetCollision);
    change.game.value = 1.0;
    return change;
  };
  for (int i = 0; i < 2500; ++i) {
    rig.change(pairOn());
    rig.tick();
  }
  EXPECT_EQ(rig.output().phase, RunPhase::kPaused);
  EXPECT_EQ(rig.output().step.step, 1U);
  EXPECT_EQ(rig.output().step.phase, StepPhase::kActive);
  rig.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(rig.tick(1990).phase, RunPhase::kRunning);
  EXPECT_EQ(rig.tick(20).phase, RunPhase::kFailed);
}

TEST(SessionSimulation, CommandsOfAPauseActAtOnceAndInTheirOrder) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick();
  rig.change({.kind = ChangeKind::kPause});
  rig.tick();
  rig.change(game(CommandKind::kSkipStep));
  rig.change(game(CommandKind::kRepeatStep));
  rig.tick();
  EXPECT_EQ(rig.output().step.phase, StepPhase::kSkipped);
  rig.tick(2);
  EXPECT_EQ(rig.output().phase, RunPhase::kPaused);
  EXPECT_EQ(rig.output().step.step, 1U) << "the repetition is of the step after the skipped one";
  EXPECT_EQ(rig.output().step.phase, StepPhase::kActive);
  EXPECT_TRUE(rig.hand(test::kRightHand).frozen);
  rig.change(game(CommandKind::kReset));
  rig.tick();
  EXPECT_EQ(rig.output().step.step, 0U);
  EXPECT_EQ(rig.output().step.phase, StepPhase::kActive);
  const std::uint32_t revision = rig.output().step.revision;
  rig.change({.kind = ChangeKind::kResume});
  rig.tick(3);
  EXPECT_EQ(rig.output().phase, RunPhase::kRunning);
  EXPECT_EQ(rig.output().step.revision, revision) << "nothing has waited for the end of the pause";
}

TEST(SessionSimulation, PauseAndResumeHaveNoEffectInOtherPhases) {
  test::SessionRig rig;
  rig.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(rig.tick().phase, RunPhase::kRunning);
  rig.change({.kind = ChangeKind::kStop});
  EXPECT_EQ(rig.tick().phase, RunPhase::kStopped);
  rig.change({.kind = ChangeKind::kPause});
  rig.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(rig.tick().phase, RunPhase::kStopped);
}

TEST(SessionSimulation, SwappedHandsHoldEachOthersObjectsAndTheStepNamesTheNewHand) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.attach(test::kLeftHand, Vector3(0.5, 0, 0.3));
  rig.tick(5);
  ASSERT_EQ(rig.output().step.hand, test::kRightHand);
  const std::uint32_t revision = rig.output().step.revision;
  rig.change(game(CommandKind::kSwapHands));
  rig.tick(2);
  EXPECT_EQ(rig.object("pointer").holder, test::kLeftHand);
  EXPECT_EQ(rig.object("spare").holder, test::kRightHand);
  EXPECT_NEAR(rig.object("pointer").X_WO.translation().x(), 0.5, 1e-3);
  EXPECT_EQ(rig.output().step.hand, test::kLeftHand) << "the hand that holds the pointer";
  EXPECT_GT(rig.output().step.revision, revision);
}

TEST(SessionSimulation, IdsOutOfRangeAreIgnored) {
  test::SessionRig rig;
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick();
  const HandId no_hand{99};
  const ObjectId no_object{99};
  for (int kind = 0; kind <= static_cast<int>(ChangeKind::kPlaceObject); ++kind)
    rig.change({.kind = static_cast<ChangeKind>(kind), .hand = no_hand, .object = no_object, .index = 9999});
  rig.reading(no_hand);
  rig.tick();
  EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kHeld);
}

std::vector<std::uint64_t> hashesOfThePlay(unsigned workers) {
  const LoadedScene loaded = test::smallSession();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded, workers, {test::kRightHand});
  std::vector<std::uint64_t> hashes;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    simulation.tick(test::playInput(tick));
    hashes.push_back(simulation.hash());
  }
  EXPECT_EQ(simulation.phase(), RunPhase::kSucceeded) << "the play must get through all states";
  return hashes;
}

TEST(SessionSimulation, ABudgetIsAnInput) {
  test::SessionRig rig;
  rig.change({.kind = ChangeKind::kBudget, .value = 3000.0});
  rig.tick();
  const simulation::Environment& environment = rig.simulation().environment();
  EXPECT_EQ(environment.workLimits().points, 3000U);
  rig.change({.kind = ChangeKind::kBudget, .value = -std::numeric_limits<double>::quiet_NaN()});
  rig.tick();
  EXPECT_EQ(environment.workLimits().points, 0U) << "NaN is no limit";
}

TEST(SessionSimulation, EqualInputsGiveEqualHashesForAnyNumberOfWorkers) {
  const auto hashes = hashesOfThePlay(1);
  EXPECT_EQ(hashes, hashesOfThePlay(1));
  EXPECT_EQ(hashes, hashesOfThePlay(2));
}

TEST(SessionSimulation, ContinuesFromACheckpointWithEqualHashes) {
  const LoadedScene loaded = test::smallSession();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded, 1, {test::kRightHand});
  std::vector<std::vector<std::uint8_t>> saved;
  std::vector<std::uint64_t> hashes;
  for (Tick tick = 1; tick <= test::kPlayTicks; ++tick) {
    simulation.tick(test::playInput(tick));
    hashes.push_back(simulation.hash());
    if (tick % 300 == 0) simulation.save(saved.emplace_back());
  }
  for (std::size_t i = 0; i < saved.size(); ++i) {
    SessionSimulation again = test::SessionRig::makeSimulation(loaded);
    const auto restored = again.restore(saved[i]);
    ASSERT_TRUE(restored) << restored.error().what;
    ASSERT_EQ(again.now(), 300 * (i + 1));
    ASSERT_EQ(again.hash(), hashes[again.now() - 1]);
    for (Tick tick = again.now() + 1; tick <= 300 * (i + 2) && tick <= test::kPlayTicks; ++tick) {
      again.tick(test::playInput(tick));
      ASSERT_EQ(again.hash(), hashes[tick - 1])
          << "tick " << tick << " after the checkpoint of tick " << 300 * (i + 1);
    }
  }
}

TEST(SessionSimulation, ACheckpointKeepsACommandThatWaitsForOneBeforeIt) {
  test::SessionRig rig;
  rig.tick();
  rig.change(game(CommandKind::kSkipStep));
  rig.change(game(CommandKind::kSkipStep));
  rig.tick();
  ASSERT_EQ(rig.output().step.skipped, 1U);
  EXPECT_EQ(rig.output().commands.waiting, 1U);
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);
  SessionSimulation again = test::SessionRig::makeSimulation(rig.loaded());
  ASSERT_TRUE(again.restore(saved));
  EXPECT_EQ(again.hash(), rig.simulation().hash());
  again.tick({.tick = 3});
  again.tick({.tick = 4});
  EXPECT_EQ(again.step().skipped, 2U);
}

TEST(SessionSimulation, TheTimeOfAStepStandsInAPause) {
  test::SessionRig rig;
  const Tick before = rig.tick(11).step.elapsed;
  EXPECT_GT(before, 0U);
  rig.change({.kind = ChangeKind::kPause});
  EXPECT_EQ(rig.tick(50).step.elapsed, before);
  rig.change({.kind = ChangeKind::kResume});
  EXPECT_EQ(rig.tick(10).step.elapsed, before + 10);
}

// one waits for the skip before it, and one comes with the stop: neither acts when the stop is cleared
TEST(SessionSimulation, AStopDropsTheCommandsThatWait) {
  test::SessionRig rig;
  rig.tick();
  rig.change(game(CommandKind::kSkipStep));
  rig.change(game(CommandKind::kSkipStep));
  rig.tick();
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 1.0});
  rig.change(game(CommandKind::kSkipStep));
  EXPECT_EQ(rig.tick(2).commands.dropped, 2U);
  rig.change({.kind = ChangeKind::kPause});
  rig.change({.kind = ChangeKind::kSetEmergencyStop, .value = 0.0});
  rig.tick(3);
  rig.change({.kind = ChangeKind::kResume});
  rig.tick(3);
  EXPECT_EQ(rig.output().phase, RunPhase::kRunning);
  EXPECT_EQ(rig.output().step.skipped, 1U);
  rig.change(game(CommandKind::kSkipStep));
  EXPECT_EQ(rig.tick().step.skipped, 2U) << "commands after it act";
}

TEST(SessionSimulation, RefusesACheckpointThatIsTruncatedOrOfAnotherScenario) {
  test::SessionRig rig(1, {test::kRightHand});
  rig.tick(3);
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);
  SessionSimulation again = test::SessionRig::makeSimulation(rig.loaded());
  for (std::size_t size = 0; size < saved.size(); size += 7)
    ASSERT_FALSE(again.restore(std::span(saved).first(size))) << size << " of " << saved.size();
  SessionSimulation other = test::SessionRig::makeSimulation(test::smallSession(test::smallScenario()));
  const auto restored = other.restore(saved);
  ASSERT_FALSE(restored);
  EXPECT_FALSE(restored.error().what.empty());
  ASSERT_TRUE(again.restore(saved)) << "a failed restore does not affect the next one";
  EXPECT_EQ(again.hash(), rig.simulation().hash());
}

TEST(SessionSimulation, AHandTakesAnObjectAtItsOwnPoseAndLetsItGoAsAnyOther) {
  const Pose X_WH(Vector3(0.3, 0.1, 0.25), Quaternion(0.6, 0.0, 0.8, 0.0));
  for (const bool attached_before : {false, true}) {
    test::SessionRig rig(1, {kRightHand, kLeftHand});  // no state begins without the left hand
    const ObjectId part = rig.loaded().scenario->objectNamed("part");
    rig.attach(kRightHand, Vector3::Zero());
    rig.reading(kRightHand).X_WH = X_WH;
    if (attached_before) rig.tick(3);
    rig.change({.kind = ChangeKind::kTake, .hand = kRightHand, .object = part});
    rig.tick();
    EXPECT_EQ(rig.hand(kRightHand).object, part);
    EXPECT_EQ(rig.hand(kRightHand).X_HO, Pose::Identity()) << "the hand's frame is the object's";
    EXPECT_EQ(rig.object("part").status, ObjectStatus::kHeld);
    EXPECT_NEAR((rig.object("part").X_WO.translation() - X_WH.translation()).norm(), 0.0, 1e-12);
    EXPECT_NEAR(game_control::angleBetween(rig.object("part").X_WO.rotation(), X_WH.rotation()), 0.0, 1e-7);
    EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kHidden) << "as while any other part is held";
    EXPECT_LT(rig.hand(kRightHand).F_Ho_W.force.norm(), 1e-9);
    rig.change({.kind = ChangeKind::kRelease, .hand = kRightHand});
    rig.tick();
    EXPECT_EQ(rig.object("part").status, ObjectStatus::kParked);
    EXPECT_EQ(rig.object("pointer").status, ObjectStatus::kHeld);
  }
}

TEST(SessionSimulation, AnExternalPoseReplacesTheOwnTrackerOfAnObjectForItsLifetime) {
  test::SessionRig rig(1, {},
                       test::with(test::twoHandedScenario(), "{name: left, object: spare}",
                                  "{name: left, kind: tracked, object: spare}"));
  rig.attach(test::kLeftHand, Vector3(0.5, 0, 0.3));
  rig.tick(5);
  ASSERT_EQ(rig.object("spare").status, ObjectStatus::kTracked);
  rig.change({.kind = ChangeKind::kPlaceObject,
              .object = rig.loaded().scenario->objectNamed("spare"),
              .lifetime_ticks = 20,
              .X_WO = Pose(Vector3(0.4, 0.1, 0.3))});
  rig.tick();
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);
  SessionSimulation again = test::SessionRig::makeSimulation(rig.loaded());
  ASSERT_TRUE(again.restore(saved));
  EXPECT_EQ(again.hash(), rig.simulation().hash());
  rig.tick(19);
  EXPECT_EQ(rig.object("spare").status, ObjectStatus::kTracked);
  EXPECT_NEAR((rig.object("spare").X_WO.translation() - Vector3(0.4, 0.1, 0.3)).norm(), 0.0, 1e-9);
  rig.tick();
  EXPECT_NEAR((rig.object("spare").X_WO.translation() - Vector3(0.5, 0, 0.3)).norm(), 0.0, 1e-9);
}

TEST(SessionSimulation, TakingWithUnknownIdsChangesNothing) {
  test::SessionRig rig;
  test::SessionRig other;
  rig.change({.kind = ChangeKind::kTake, .hand = HandId{9}, .object = ObjectId{1}});
  rig.change({.kind = ChangeKind::kTake, .hand = kRightHand, .object = ObjectId{}});
  EXPECT_EQ(rig.tick().hash, other.tick().hash);
}

/// Where `part` begins in `whole`.
std::size_t positionOf(const std::vector<std::uint8_t>& part, const std::vector<std::uint8_t>& whole) {
  const auto found = std::search(whole.begin(), whole.end(), part.begin(), part.end());
  EXPECT_NE(found, whole.end());
  return static_cast<std::size_t>(found - whole.begin());
}

TEST(SessionSimulation, RefusesACheckpointWithANumberThatIsNotFinite) {
  test::SessionRig rig(1, {});
  rig.attach(test::kRightHand, kFreeSpace);
  rig.tick(5);
  Change waiting = game(CommandKind::kSkipStep);
  rig.change(waiting);
  waiting.game.value = 1234.5;
  rig.change(waiting);
  rig.tick();
  std::vector<std::uint8_t> saved;
  rig.simulation().save(saved);

  // the value of the command that waits, all numbers of the environment, then (it ends the checkpoint) of the
  // state machine
  const auto* value = reinterpret_cast<const std::uint8_t*>(&waiting.game.value);
  std::vector<std::size_t> doubles{positionOf({value, value + sizeof(double)}, saved)};
  const simulation::Environment& environment = rig.simulation().environment();
  const std::size_t environment_at = positionOf(environment.save(), saved);
  for (const std::size_t at : environment.savedDoubles()) doubles.push_back(environment_at + at);
  const game_control::StateMachine machine(rig.loaded().scenario);
  const std::size_t machine_at = saved.size() - machine.save().size();
  ASSERT_EQ(machine_at, environment_at + environment.save().size() + sizeof(std::uint32_t));
  for (const std::size_t at : machine.savedDoubles()) doubles.push_back(machine_at + at);

  SessionSimulation again = test::SessionRig::makeSimulation(rig.loaded());
  for (const std::size_t at : doubles) {
    for (const double number :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      std::vector<std::uint8_t> bad = saved;
      std::memcpy(bad.data() + at, &number, sizeof number);
      ASSERT_FALSE(again.restore(bad)) << number << " at byte " << at;
    }
  }
  std::vector<std::uint8_t> longer = saved;
  longer.push_back(0);
  EXPECT_FALSE(again.restore(longer));
  ASSERT_TRUE(again.restore(saved));
  EXPECT_EQ(again.hash(), rig.simulation().hash());
}

TEST(SessionSimulation, ATickAllocatesNothingAndLocksNothing) {
  const LoadedScene loaded = test::smallSession();
  SessionSimulation simulation = test::SessionRig::makeSimulation(loaded, 2, {test::kRightHand});
  TickOutput output = simulation.makeOutput();
  simulation.tick(test::playInput(1));  // warm-up
  simulation.fill(output);
  std::int64_t allocations = 0;
  std::int64_t locks = 0;
  for (Tick tick = 2; tick <= test::kPlayTicks; ++tick) {
    const TickInput input = test::playInput(tick);
    const test::RealtimeGuard guard(test::CountedThreads::kAll);
    simulation.tick(input);
    simulation.fill(output);
    allocations += guard.allocations();
    locks += guard.locks();
  }
  EXPECT_EQ(simulation.phase(), RunPhase::kSucceeded);
  EXPECT_EQ(allocations, 0);
  EXPECT_EQ(locks, 0);
}

}  // namespace
}  // namespace tenon::session
