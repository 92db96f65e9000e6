#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/support/known_shortfall.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::moveHandTo;
using test::stepTicks;

constexpr double kGravity = 9.81;
constexpr double kPartMass = 0.4;
const Vector3 kPartSize(0.06, 0.05, 0.04);

//   hand o->[  box  ]   without gravity; the hand pushes it away
TEST(FreeBodyAndHand, TheImpulseOnTheHandIsTheMomentumOfTheBody) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, Vector3::Zero(), true);
  const ObjectId pointer = small.object("pointer", test::pointerShape(), {-0.1, 0.0, 0.0});
  const HandId hand = small.hand("hand", pointer);
  small.pair(pointer, box);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {-0.05, 0.0, 0.0});
  Vector3 impulse = Vector3::Zero();
  double speed = 0.0;
  double x = -0.05;
  for (int tick = 0; tick < 600; ++tick) {
    speed = std::min(0.2, speed + 0.5 * kTickSeconds);
    x += speed * kTickSeconds;
    environment.setHandPose(hand, Pose(Vector3(x, 0.0, 0.0)), {});
    environment.step();
    impulse -= environment.hands()[hand.value].F_Ho_W.force * kTickSeconds;
  }
  const Vector3 momentum = kPartMass * environment.objects()[box.value].V_WO.linear;
  EXPECT_GT(momentum.x(), 0.05);
  EXPECT_LE((impulse - momentum).norm(), 0.02 * momentum.norm());
}

//   without friction the box accelerates by F / m; with it by F / m - mu g
TEST(FreeBodyAndHand, ABoxPushedAlongTheFloorAcceleratesByForceMinusCoulombFriction) {
  for (const double friction : {0.0, 0.3}) {
    test::SmallScene small;
    const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
    const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {-0.1, 0.0, 0.5 * kPartSize.z()});
    small.spec(box).body->friction = friction;
    small.pair(box, ground);
    Environment environment(small.build(), {});
    test::stepTicks(environment, 200);
    const double force = 2.0;  // [N] through its centre; half of its weight
    constexpr int kTicks = 300;
    for (int tick = 0; tick < kTicks; ++tick) {
      environment.contribute(box, 1, {Vector3(force, 0.0, 0.0), Vector3::Zero()}, 100);
      environment.step();
    }
    const double applied = force * (1.0 - 1.0 / 200.0);
    const double expected = std::max(applied / kPartMass - friction * kGravity, 0.0) * kTicks * kTickSeconds;
    EXPECT_NEAR(environment.objects()[box.value].V_WO.linear.x(), expected, std::max(0.02 * expected, 1e-3))
        << friction;
  }
}

//  a slope of 20 degrees, by turning gravity
TEST(FreeBodyAndHand, ABoxOnASlopeSlidesOrSticksByCoulombFriction) {
  const double angle = 20.0 / 180.0 * std::numbers::pi;
  for (const double friction : {0.0, 0.2}) {
    test::SmallScene small;
    const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
    const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {-0.1, 0.0, 0.5 * kPartSize.z()});
    small.spec(box).body->friction = friction;
    small.pair(box, ground);
    small.gravity({kGravity * std::sin(angle), 0.0, -kGravity * std::cos(angle)});
    Environment environment(small.build(), {});
    test::stepTicks(environment, 300);
    const double expected = std::max(std::sin(angle) - friction * std::cos(angle), 0.0) * kGravity * 0.3;
    EXPECT_NEAR(environment.objects()[box.value].V_WO.linear.x(), expected, std::max(0.02 * expected, 1e-3))
        << friction;
  }
}

/// [m/s] Mean speed along x from tick 100 to tick 400 of a box on the floor, of friction `friction` [-] at
/// rest and sliding, under gravity turned by `slope` [rad] and a force of `push` [N].
double creepOf(double friction, double slope, double push) {
  test::SmallScene small;
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {-0.1, 0.0, 0.5 * kPartSize.z()});
  small.spec(box).body->friction = friction;
  small.pair(box, ground);
  small.gravity({kGravity * std::sin(slope), 0.0, -kGravity * std::cos(slope)});
  Environment environment(small.build(), {});
  const auto x = [&] { return environment.objects()[box.value].X_WO.translation().x(); };
  const auto step = [&](int ticks) {
    for (int tick = 0; tick < ticks; ++tick) {
      if (push > 0.0) environment.contribute(box, 1, {Vector3(push, 0.0, 0.0), Vector3::Zero()}, 100);
      environment.step();
    }
  };
  step(100);
  const double before = x();
  step(300);
  return (x() - before) / (300 * kTickSeconds);
}

// below the limit of friction a body at rest stays at rest: it must not creep
constexpr double kStill = 1e-6;  // [m/s]

TEST(FreeBodyAndHand, ABoxPushedWithLessThanTheLimitOfFrictionStaysAtRest) {
  const double limit = 0.6 * kPartMass * kGravity;  // [N]
  for (const double part : {0.5, 0.85})
    EXPECT_TRUE(test::knownShortfall(creepOf(0.6, 0.0, part * limit), kStill, 5e-3)) << part;
}

TEST(FreeBodyAndHand, ABoxOnASlopeBelowTheLimitOfFrictionStaysAtRest) {
  for (const double friction : {0.5, 0.8}) {
    EXPECT_TRUE(test::knownShortfall(creepOf(friction, 20.0 / 180.0 * std::numbers::pi, 0.0), kStill, 5e-3))
        << friction;
  }
}

//   a small box falls 1.5 m, reaches the speed cap, and hits a sheet of 1 mm
TEST(FreeBodyAndHand, ABoxAtTheSpeedCapDoesNotFallThroughAThinSheet) {
  for (const double offset : {0.0, 0.0004, 0.0011}) {
    test::SmallScene small;
    const auto sheet = test::sheetStructures(0.2, 0.001, 0.003, offset);
    const ObjectId floor = small.object("sheet", sheet, Vector3::Zero());
    const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, 1.5});
    small.pair(box, floor, false, 0.87 * 0.003);
    Environment environment(small.build(), {});
    double fastest = 0.0;
    for (int tick = 0; tick < 1500; ++tick) {
      environment.step();
      const ObjectMotion& motion = environment.objects()[box.value];
      fastest = std::max(fastest, motion.V_WO.linear.norm());
      ASSERT_GT(motion.X_WO.translation().z(), 0.5 * kPartSize.z()) << tick;
    }
    EXPECT_NEAR(fastest, EnvironmentOptions{}.max_free_speed, 0.01);
    EXPECT_TRUE(environment.objects()[box.value].asleep);
  }
}

/// A box held by a hand, with nothing below it.
struct BoxInAHand {
  BoxInAHand() {
    test::activateHand(environment, hand, {0.0, 0.0, 1.0});
    environment.grab(hand, box);
    test::stepTicks(environment, 10);
  }
  [[nodiscard]] const ObjectMotion& motion() const { return environment.objects()[box.value]; }

  test::SmallScene small;
  ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, 1.0});
  HandId hand = small.hand("hand", small.object("pointer", test::pointerShape(), {-0.1, 0.0, 1.0}));
  Environment environment{small.build(), {}};
};

TEST(FreeBodyAndHand, AReleasedBodyKeepsItsVelocityAndFalls) {
  BoxInAHand held;
  EXPECT_EQ(held.motion().status, ObjectStatus::kHeld);
  const Vector3 p_WB = held.motion().X_WO.translation();
  test::stepTicks(held.environment, 100);
  EXPECT_EQ(held.motion().X_WO.translation(), p_WB) << "the hand holds it";
  test::moveHandTo(held.environment, held.hand, {0.1, 0.0, 1.0}, 200);
  held.environment.release(held.hand);
  EXPECT_EQ(held.motion().status, ObjectStatus::kFree);
  test::stepTicks(held.environment, 100);
  EXPECT_NEAR(held.motion().V_WO.linear.x(), 0.5, 0.01) << "it keeps the velocity of the hand";
  EXPECT_NEAR(held.motion().V_WO.linear.z(), -kGravity * 0.1, 1e-6);
}

TEST(FreeBodyAndHand, AHandThatLeavesDoesNotDropItsBody) {
  BoxInAHand held;
  const Pose X_WB = held.motion().X_WO;
  held.environment.setHandPresent(held.hand, false);
  test::stepTicks(held.environment, 100);
  EXPECT_EQ(held.motion().X_WO, X_WB) << "parked until the hand is back";
}

TEST(FreeBodyAndHand, ABodyReleasedFromAnAbsentHandFalls) {
  BoxInAHand held;
  held.environment.setHandPresent(held.hand, false);
  test::stepTicks(held.environment, 10);
  held.environment.release(held.hand);
  EXPECT_EQ(held.motion().status, ObjectStatus::kFree);
  test::stepTicks(held.environment, 100);
  EXPECT_NEAR(held.motion().V_WO.linear.z(), -kGravity * 0.1, 1e-6);
}

TEST(FreeBodyAndHand, AfterAPauseAFreeBodyFallsFromRest) {
  test::SmallScene small;
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, 1.0});
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  small.pair(box, ground);
  Environment environment(small.build(), {});
  test::stepTicks(environment, 100);
  environment.setFreeBodiesPaused(true);
  const Pose X_WB = environment.objects()[box.value].X_WO;
  test::stepTicks(environment, 50);
  EXPECT_EQ(environment.objects()[box.value].X_WO, X_WB);
  const std::vector<std::uint8_t> bytes = environment.save();
  Environment other(small.build(), {});
  ASSERT_TRUE(other.restore(bytes));
  test::stepTicks(other, 50);
  EXPECT_EQ(other.objects()[box.value].X_WO, X_WB) << "the pause is restored too";
  environment.setFreeBodiesPaused(false);
  test::stepTicks(environment, 100);
  EXPECT_NEAR(environment.objects()[box.value].V_WO.linear.z(), -kGravity * 0.1, 1e-6);
  test::stepTicks(environment, 1000);
  EXPECT_NEAR(environment.objects()[box.value].X_WO.translation().z(), 0.5 * kPartSize.z(), 5e-5);
}

TEST(FreeBodyAndHand, ASleepingBodyStaysWhenAHandPushesAtItDuringAPause) {
  test::SmallScene small;
  const double height = 0.5 * kPartSize.z();
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, height + 1e-4});
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  const ObjectId pointer = small.object("pointer", test::pointerShape(), {-0.2, 0.0, height});
  const HandId hand = small.hand("hand", pointer);
  small.pair(box, ground);
  small.pair(pointer, box);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {-0.2, 0.0, height});
  test::stepTicks(environment, 300);
  ASSERT_TRUE(environment.objects()[box.value].asleep);
  const Pose X_WB = environment.objects()[box.value].X_WO;
  environment.setFreeBodiesPaused(true);
  test::moveHandTo(environment, hand, {0.0, 0.0, height}, 400);
  EXPECT_EQ(environment.objects()[box.value].X_WO, X_WB);
  EXPECT_FALSE(environment.objects()[box.value].asleep) << "the hand has woken it";
  environment.setFreeBodiesPaused(false);
  test::stepTicks(environment, 100);
  EXPECT_GT(environment.objects()[box.value].X_WO.translation().x(), 0.01) << "and pushes it now";
}

TEST(FreeBodyAndHand, ABodyFallsWhenItJoinsTheGroupOfItsSupport) {
  test::SmallScene small;
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, 0.5 * kPartSize.z() + 1e-4});
  small.pair(box, ground);
  Environment environment(small.build(), {});
  test::stepTicks(environment, 300);
  ASSERT_TRUE(environment.objects()[box.value].asleep);
  environment.setGroup(ground, 3);
  environment.setGroup(box, 3);
  test::stepTicks(environment, 100);
  EXPECT_NEAR(environment.objects()[box.value].V_WO.linear.z(), -kGravity * 0.1, 1e-6);
}

TEST(FreeBodyAndHand, ABodyPlacedInsideTheFloorGainsNoEnergy) {
  test::SmallScene small;
  const ObjectId ground = small.object("ground", test::floorShape(), Vector3::Zero());
  const ObjectId box = small.freeBox("box", kPartSize, kPartMass, {0.0, 0.0, 0.5 * kPartSize.z() - 0.004});
  small.pair(box, ground);
  Environment environment(small.build(), {});
  double highest = 0.0;
  for (int tick = 0; tick < 500; ++tick) {
    environment.step();
    highest = std::max(highest, environment.objects()[box.value].X_WO.translation().z());
  }
  EXPECT_LE(highest, 0.5 * kPartSize.z() + 1e-4);
}

TEST(FreeBodyAndHand, AnObjectWithoutMassIsNeverFree) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), Vector3::Zero(), ObjectStatus::kFree);
  Environment environment(small.build(), {});
  EXPECT_EQ(environment.objects()[part.value].status, ObjectStatus::kParked);
  environment.place(part, Pose(), ObjectStatus::kFree);
  EXPECT_EQ(environment.objects()[part.value].status, ObjectStatus::kParked);
}

}  // namespace
}  // namespace tenon::simulation
