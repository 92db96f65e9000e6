#include "clients/haptic/scene_copy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/switch_slew.h"
#include "idl/types/motion_law.h"
#include "tests/clients/haptic/delayed_station.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/support/realtime_guard.h"

namespace tenon::haptic {
namespace {

using test::SmallScene;

using test::blocks;
using test::DelayedStation;
using test::kBlock;
using test::kEdge;
using test::kGround;
using test::kLeft;
using test::kPart;
using test::kRight;
using test::kStiffness;

const Vector3 kAway(0.2, 0.0, 0.2);  // [m] for the left hand

/// Comes down to the floor, presses by about 1 mm and slides to and fro.
Vector3 pressing(Tick tick) {
  const double t = 1e-3 * static_cast<double>(tick);
  const double down = std::clamp((t - 0.5) / 0.5, 0.0, 1.0);
  return {0.02 * std::sin(4.0 * t), 0.0, 0.05 - 0.031 * down - 0.0005 * std::sin(6.0 * t) * down};
}

TEST(SceneCopy, FeelsWhatStandsStillAsWithoutADelay) {
  DelayedStation near(0), far(100);
  double largest = 0.0, error = 0.0, error_of_manifold = 0.0;
  for (Tick tick = 1; tick <= 3000; ++tick) {
    const Vector3 p_WH = pressing(tick);
    near.tick(p_WH, kAway);
    far.tick(p_WH, kAway);
    if (tick < 400) continue;
    const Vector3 felt = DelayedStation::force(near.local.proxy(), p_WH);
    largest = std::max(largest, felt.norm());
    ASSERT_TRUE(far.copy.ready());
    error = std::max(error, (DelayedStation::force(far.copy.proxy(), p_WH) - felt).norm());
    error_of_manifold =
        std::max(error_of_manifold, (DelayedStation::force(far.local.proxy(), p_WH) - felt).norm());
  }
  EXPECT_GT(largest, 2.0);
  EXPECT_LT(error, 0.01 * largest);
  // what only tells something since a first contact is felt late by the other model
  EXPECT_GT(error_of_manifold, 0.2 * largest);
}

/// [m] Place of the left hand: at rest, then to and fro along x at 0.1 m/s, with 4 m/s^2 at its turns.
double moving(Tick tick) {
  constexpr double kPeriod = 1.0, kSpeed = 0.1, kTurn = 0.05;
  const auto triangle = [](double t) {
    const double phase = t - std::floor(t / kPeriod) * kPeriod;
    return kSpeed * (phase < 0.5 * kPeriod ? phase : kPeriod - phase);
  };
  double sum = 0.0;
  for (int i = 0; i < 50; ++i)
    sum += triangle(std::max(0.0, 1e-3 * (static_cast<double>(tick) - 600.0) - kTurn * (i + 0.5) / 50.0));
  return sum / 50.0;
}

TEST(SceneCopy, FeelsWhatMovesSteadilyWithinATenthAndItsTurnsWithinTheLawsBound) {
  constexpr Tick kDelay = 50;
  constexpr double kAcceleration = 4.0, kAhead = 0.051;
  // the part goes its own way, whatever touches it
  const auto scene = blocks(100.0 * kStiffness);
  DelayedStation near(0, scene), far(kDelay, scene);
  double steady = 0.0, turning = 0.0;
  for (Tick tick = 1; tick <= 4000; ++tick) {
    // the block is 1 mm deep in the part, and moves with it
    const Vector3 p_WLeft(0.1 + moving(tick), 0.0, 0.1);
    const double closer = std::clamp((static_cast<double>(tick) - 300.0) / 200.0, 0.0, 1.0);
    const Vector3 p_WH(p_WLeft.x() - kEdge - 0.01 + 0.011 * closer, 0.0, 0.1);
    near.tick(p_WH, p_WLeft);
    far.tick(p_WH, p_WLeft);
    if (tick < 1300) continue;
    const Vector3 felt = DelayedStation::force(near.local.proxy(), p_WH);
    const double error = (DelayedStation::force(far.copy.proxy(), p_WH) - felt).norm();
    const bool is_steady = (tick - 600) % 500 > 250;
    (is_steady ? steady : turning) =
        std::max(is_steady ? steady : turning, error / (is_steady ? felt.norm() : 1.0));
  }
  EXPECT_LT(steady, 0.1);
  // the filtered twist is as much older as the filter is long
  const double lag = kAcceleration * kAhead * SceneCopy::kTwistFilter;
  EXPECT_LT(turning, kStiffness * (extrapolationError(kAcceleration, kAhead) + lag) + 0.5);
  EXPECT_GT(turning, 0.5);  // or nothing turned
}

TEST(SceneCopy, APartThatAnotherHandHoldsGivesWayAtOnce) {
  DelayedStation near(0), far(50);
  double squares = 0.0, square_errors = 0.0, error_of_manifold = 0.0, given_way = 0.0;
  for (Tick tick = 1; tick <= 4000; ++tick) {
    // both move to and fro at 0.1 m/s, with the block 2 mm deep in the part; in the server it comes 5 mm late
    const Vector3 p_WLeft(0.1 + moving(tick), 0.0, 0.1);
    const double closer = std::clamp((static_cast<double>(tick) - 300.0) / 200.0, 0.0, 1.0);
    const Vector3 p_WH(p_WLeft.x() - kEdge - 0.01 + 0.012 * closer, 0.0, 0.1);
    near.tick(p_WH, p_WLeft);
    far.tick(p_WH, p_WLeft);
    if (tick < 1300 || (tick - 600) % 500 < 250) continue;
    const Vector3 felt = DelayedStation::force(near.local.proxy(), p_WH);
    squares += felt.squaredNorm();
    square_errors += (DelayedStation::force(far.copy.proxy(), p_WH) - felt).squaredNorm();
    error_of_manifold += (DelayedStation::force(far.local.proxy(), p_WH) - felt).squaredNorm();
    given_way = std::max(given_way,
                         far.copy.environment().objects()[kPart.value].X_WO.translation().x() - p_WLeft.x());
  }
  EXPECT_LT(std::sqrt(square_errors / squares), 0.1);
  EXPECT_GT(std::sqrt(error_of_manifold / squares), 0.5) << "or it is no feat";
  EXPECT_NEAR(given_way, 1e-3, 3e-4) << "[m], of springs that are equally stiff";
}

TEST(SceneCopy, AHandThatLeavesItsPartCloseByLeavesItWhereItIs) {
  DelayedStation far(25);
  const Vector3 p_WH(0.05, 0.0, 0.1), p_WLeft(0.1, 0.0, 0.1);  // 10 mm apart
  for (Tick tick = 1; tick <= 500; ++tick) far.tick(p_WH, p_WLeft);
  ASSERT_TRUE(far.copy.environment().hands()[kLeft.value].attached) << "it is simulated";
  far.server().setHandPresent(kLeft, false);
  for (Tick tick = 1; tick <= 500; ++tick) far.tick(p_WH, p_WLeft);
  EXPECT_FALSE(far.copy.environment().hands()[kLeft.value].present);
  const Pose X_WO = far.copy.environment().objects()[kPart.value].X_WO;
  EXPECT_LT((X_WO.translation() - p_WLeft).norm(), 1e-6);
}

//   both people are at the block; the other one goes along the floor, out of reach
TEST(SceneCopy, AHandThatGoesOutOfReachCostsNothingAnyMore) {
  constexpr std::size_t kPartAndFloor = 2;
  DelayedStation far(25);
  const Vector3 p_WH(0.0, 0.0, 0.1);
  Vector3 p_WLeft(0.1, 0.0, 0.1);
  const auto isSimulated = [&] { return far.copy.environment().pairs()[kPartAndFloor].enabled; };
  for (Tick tick = 1; tick <= 500; ++tick) far.tick(p_WH, p_WLeft);
  ASSERT_TRUE(isSimulated());
  for (const bool frozen : {true, false}) {
    far.server().setHandFrozen(kLeft, frozen);
    for (Tick tick = 1; tick <= 300; ++tick) far.tick(p_WH, p_WLeft);
    EXPECT_TRUE(isSimulated()) << "one that is frozen may go on";
  }
  for (Tick tick = 1; tick <= 1000; ++tick) far.tick(p_WH, p_WLeft += Vector3(1e-4, 0.0, 0.0));
  EXPECT_FALSE(isSimulated());
  for (Tick tick = 1; tick <= 300; ++tick) far.tick(p_WH, p_WLeft);
  EXPECT_LT((far.copy.environment().objects()[kPart.value].X_WO.translation() - p_WLeft).norm(), 1e-4);
  for (Tick tick = 1; tick <= 1000; ++tick) far.tick(p_WH, p_WLeft -= Vector3(1e-4, 0.0, 0.0));
  EXPECT_TRUE(isSimulated()) << "and back";
}

//   the other one moves a shared part at 0.1 m/s when the link fails
TEST(SceneCopy, TheGoalOfASharedPartGoesOnInASilenceAsFarAsTheLawSays) {
  constexpr double kSpeed = 0.1;  // [m/s]
  DelayedStation far(100);
  const Vector3 p_WH(0.0, 0.0, 0.1);
  Vector3 p_WLeft(0.2, 0.0, 0.1);
  for (Tick tick = 1; tick <= 500; ++tick) far.tick(p_WH, p_WLeft);
  far.server().grab(kLeft, kBlock);
  const auto move = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) far.tick(p_WH, p_WLeft += Vector3(0.0, kSpeed * kTickSeconds, 0.0));
  };
  move(500);
  far.is_silent = true;
  move(600);
  ASSERT_TRUE(far.copy.ready());
  const auto goal = [](const simulation::HandMotion& hand) { return hand.X_WH * hand.X_HO; };
  const double heard = far.local.manifold().others[0].X_WG.translation().y();
  const double gone = goal(far.copy.environment().hands()[kLeft.value]).translation().y() - heard;
  EXPECT_GT(gone, 0.9 * kSpeed * kLongestExtrapolation);
  EXPECT_LT(gone, 1.01 * kSpeed * kLongestExtrapolation);
}

/// A block in the right hand, and before it a free part on the floor or, `floating`, in the air.
std::shared_ptr<const simulation::Scene> freePart(bool floating) {
  SmallScene small;
  const double height = floating ? 0.2 : 0.5 * kEdge + 1e-5;
  small.object("block", test::boxShape(Vector3::Constant(kEdge)), {0.0, 0.0, height});
  small.freeBox("part", Vector3::Constant(kEdge), 1.0, {0.06, 0.0, height}, floating);
  small.object("floor", test::boxShape({0.5, 0.3, 0.04}), {0.0, 0.0, -0.02}, ObjectStatus::kFixed);
  small.spec(kPart).body->damping = 10.0;
  small.spec(kPart).body->friction = 0.3;
  small.hand("right", kBlock);
  small.pair(kBlock, kGround);
  small.pair(kBlock, kPart);
  small.pair(kPart, kGround);
  auto scene = std::make_shared<simulation::Scene>(*small.build());
  scene->hands[0].stiffness = kStiffness;
  return scene;
}

class PushedPart : public testing::TestWithParam<bool> {};

TEST_P(PushedPart, IsFeltWithinATenthOfWhatItIsWithoutADelay) {
  const auto scene = freePart(GetParam());
  DelayedStation near(0, scene), far(50, scene);
  const double height = scene->objects[kBlock.value].X_WO.translation().z();
  double squares = 0.0, square_errors = 0.0, apart = 0.0;
  for (Tick tick = 1; tick <= 3000; ++tick) {
    const double t = 1e-3 * static_cast<double>(tick);
    // at rest, 0.1 m/s with the part, at rest, and back without it
    const double way = 0.1 * std::clamp(t - 0.6, 0.0, 1.0) - 0.1 * std::clamp(t - 2.2, 0.0, 0.5);
    const Vector3 p_WH(way, 0.0, height + 1e-4);
    near.tick(p_WH, kAway);
    far.tick(p_WH, kAway);
    if (tick < 500) continue;
    const Vector3 felt = DelayedStation::force(near.local.proxy(), p_WH);
    squares += felt.squaredNorm();
    square_errors += (DelayedStation::force(far.copy.proxy(), p_WH) - felt).squaredNorm();
    apart = std::max(apart, (far.copy.environment().objects()[kPart.value].X_WO.translation() -
                             near.server().objects()[kPart.value].X_WO.translation())
                                .norm());
  }
  EXPECT_GT(near.server().objects()[kPart.value].X_WO.translation().x(), 0.1) << "it was pushed";
  EXPECT_GT(std::sqrt(squares / 2500.0), 0.3) << "[N], it resisted";
  EXPECT_LT(std::sqrt(square_errors / squares), 0.1);
  EXPECT_LT(apart, 1e-3);
}
INSTANTIATE_TEST_SUITE_P(SceneCopy, PushedPart, testing::Bool());

TEST(SceneCopy, AnotherHandsPullIsFelt) {
  DelayedStation far(25);
  for (Tick tick = 1; tick <= 500; ++tick) far.tick({0.0, 0.0, 0.1}, {0.0, 0.0, 0.2});
  far.server().grab(kLeft, kBlock);
  for (Tick tick = 1; tick <= 1000; ++tick) far.tick({0.0, 0.0, 0.1}, {0.0, 0.005, 0.2});
  ASSERT_TRUE(far.copy.ready());
  const Vector3 felt = DelayedStation::force(far.copy.proxy(), {0.0, 0.0, 0.1});
  EXPECT_GT(felt.y(), 2.0);
  EXPECT_NEAR(felt.y(), far.server().hands()[kRight.value].F_Ho_W.force.y(), 0.1 * felt.y());
}

TEST(SceneCopy, PairsThatTheServersMatrixExcludesAreNotFelt) {
  DelayedStation far(25);
  far.server().setPairEnabled(0, false);
  CollisionMatrix matrix;
  matrix.bits = {0b110};
  far.copy.receive(matrix);
  for (Tick tick = 1; tick <= 1500; ++tick) far.tick(pressing(tick), kAway);
  ASSERT_TRUE(far.copy.ready());
  EXPECT_LT(DelayedStation::force(far.copy.proxy(), pressing(1500)).norm(), 0.05);
}

TEST(SceneCopy, AProxyThatTheServerHasElsewhereIsAJump) {
  DelayedStation far(25);
  for (Tick tick = 1; tick <= 1500; ++tick) {
    far.tick(pressing(tick), kAway);
    ASSERT_FALSE(far.copy.jumped()) << tick;
  }
  far.server().setPairEnabled(0, false);  // of which the station is not told
  bool jumped = false;
  for (Tick tick = 1501; tick <= 2500 && !jumped; ++tick) {
    far.tick(pressing(1500) - Vector3(0.0, 0.0, 0.004), kAway);
    jumped = far.copy.jumped();
  }
  EXPECT_TRUE(jumped);
}

TEST(SceneCopy, ACycleAllocatesNothingAndLocksNothing) {
  DelayedStation far(5);
  for (Tick tick = 1; tick <= 1500; ++tick) far.tick(pressing(tick), {0.06, 0.0, 0.019});
  HandManifold heard = far.local.manifold();
  ServerTime time;
  const test::RealtimeGuard guard;
  for (std::uint32_t i = 1; i <= 500; ++i) {
    const Pose X_WH(pressing(1500 + i));
    heard.tick = 1500 + i;
    heard.answers_seq = 1490 + i;
    far.copy.step(X_WH, far.world());
    time.receive(heard, 1500 + i);
    far.copy.compute(heard, 1500 + i, time, X_WH, {}, far.world(), true);
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_TRUE(far.copy.ready());
}

class SwitchSlewTest : public testing::Test {
 protected:
  static Wrench ofForce(double x, double y) { return {Vector3(x, y, 0.0), Vector3::Zero()}; }
  /// From one model to another: cycles until the force is the other one's.
  int go(const Wrench& from, const Wrench& to) {
    EXPECT_EQ(slew.step(from, kTickSeconds).force, from.force);
    slew.begin();
    int cycles = 0;
    for (Vector3 before = from.force; cycles < 1000 && before != to.force; ++cycles) {
      const Vector3 force = slew.step(to, kTickSeconds).force;
      EXPECT_LE((force - before).norm(), 2.02 + 1e-9) << cycles;
      EXPECT_LE(force.norm() - before.norm(), 0.02 + 1e-9) << cycles;
      before = force;
    }
    return cycles;
  }
  SwitchSlew slew{devices::SafetyLimits{.start_force_slew = 20.0, .start_torque_slew = 0.4}};
};

TEST_F(SwitchSlewTest, AForceFallsByTwoNewtonsAMillisecond) { EXPECT_NEAR(go(ofForce(6.0, 0.0), {}), 3, 1); }

TEST_F(SwitchSlewTest, AForceGrowsByTwentyNewtonsASecond) {
  EXPECT_NEAR(go(ofForce(2.0, 0.0), ofForce(7.0, 0.0)), 250, 1);
}

TEST_F(SwitchSlewTest, AForceThatTurnsLeavesAtOnceAndComesSlowly) {
  EXPECT_NEAR(go(ofForce(6.0, 0.0), ofForce(0.0, 3.0)), 150, 1);
}

TEST_F(SwitchSlewTest, WhatTheNewModelNoLongerAsksForIsNotPushedBackward) {
  static_cast<void>(slew.step({}, kTickSeconds));
  slew.begin();
  for (int i = 0; i < 50; ++i) static_cast<void>(slew.step(ofForce(10.0, 0.0), kTickSeconds));
  EXPECT_EQ(slew.step({}, kTickSeconds).force, Vector3::Zero());
}

TEST(MotionLaw, KeepsTheTwistOfTheCentreAndEnds) {
  const Vector3 p_OQ(0.1, 0.0, 0.0);
  // turns about Q, which moves along y
  Twist V_WO{Vector3(0.0, 0.5, 0.0), Vector3(0.0, 0.0, 2.0)};
  V_WO.linear -= V_WO.angular.cross(p_OQ);
  const Pose X_W1 = extrapolated(Pose(), V_WO, p_OQ, 0.1);
  EXPECT_TRUE((X_W1 * p_OQ).isApprox(Vector3(0.1, 0.05, 0.0), 1e-12));
  EXPECT_NEAR(logRotation(X_W1.rotation()).z(), 0.2, 1e-12);
  EXPECT_EQ(extrapolated(Pose(), V_WO, p_OQ, 10.0), extrapolated(Pose(), V_WO, p_OQ, kLongestExtrapolation));
  EXPECT_EQ(extrapolated(Pose(), V_WO, p_OQ, -1.0), Pose());
}

TEST(MotionLaw, ItsErrorIsWithinTheBound) {
  constexpr double kA = 4.0, kT = 0.05;
  // v = 0.1 m/s, then braked with kA
  const double place = 0.1 * kT - 0.5 * kA * kT * kT;
  const Pose law = extrapolated(Pose(), {Vector3(0.1, 0.0, 0.0), Vector3::Zero()}, Vector3::Zero(), kT);
  EXPECT_LE(std::abs(law.translation().x() - place), extrapolationError(kA, kT) + 1e-15);
}

HandManifold answer(Tick tick, std::uint32_t answered) {
  HandManifold manifold;
  manifold.tick = tick;
  manifold.answers_seq = answered;
  return manifold;
}

TEST(ServerTime, TakesTheFastestAnswerAndHalfOfTheRoundTrip) {
  ServerTime time;
  EXPECT_FALSE(time.known());
  time.setRoundTrip(0.010);
  // the server is 100 ticks ahead; an answer takes 5 at least, and the inputs were kept back for some
  for (std::uint32_t seq = 20; seq < 120; ++seq) {
    const std::uint32_t late = seq % 7 == 0 ? 0 : seq % 5;
    time.receive(answer(100 + seq - 6 - late, seq - 11 - late - (seq % 3)), seq);
  }
  ASSERT_TRUE(time.known());
  EXPECT_NEAR(time.tickOf(200), 300.0, 0.5);
  // a link that has become longer is known after two windows
  time.setRoundTrip(0.020);
  for (std::uint32_t seq = 120; seq < 4200; ++seq) time.receive(answer(100 + seq - 11, seq - 21), seq);
  EXPECT_NEAR(time.tickOf(5000), 5100.0, 0.5);
  time.setRoundTrip(std::numeric_limits<double>::quiet_NaN());
  EXPECT_NEAR(time.tickOf(5000), 5090.0, 0.5);
}

TEST(ServerTime, OfALinkThatBecomesLongerOrShorterIsWithinItsBound) {
  constexpr double kOffset = 100.0, kNear = 5.0, kFar = 30.0;  // [ticks]
  constexpr std::uint32_t kLonger = 10'000, kShorter = 30'000;
  constexpr std::uint32_t kTripKnown = 5000, kTripSeen = 1200;  // [ticks] after the change
  ServerTime time;
  time.setRoundTrip(2.0 * kNear * kTickSeconds);
  for (std::uint32_t seq = 200; seq < 45'000; ++seq) {
    const double way = seq >= kLonger && seq < kShorter ? kFar : kNear;
    if (seq == kLonger + kTripKnown) time.setRoundTrip(2.0 * kFar * kTickSeconds);
    if (seq == kShorter + kTripSeen) time.setRoundTrip(2.0 * kNear * kTickSeconds);
    time.receive(answer(static_cast<Tick>(kOffset + seq - 1 - way), seq - 50), seq);
    const double error = time.tickOf(seq) - (kOffset + seq);
    const bool is_blind = seq >= kShorter && seq < kShorter + kTripSeen;
    ASSERT_GE(error, -0.5) << seq;
    ASSERT_LE(error, is_blind ? kFar - kNear + 0.5 : 0.5) << seq;
  }
}

}  // namespace
}  // namespace tenon::haptic
