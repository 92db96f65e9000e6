#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/support/distant_origin.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::kPointerRadius;
using test::moveHandTo;
using test::stepTicks;

constexpr double kStiffness = 1000.0;

//      o   the hand goes 20 mm below the pointer's contact position
//   ~~~|~~~ floor, z = 0
//      v
TEST(Environment, AFloorStopsThePointerAndItsCouplingPushesTheHandBack) {
  test::SmallScene small;
  const ObjectId pointer = small.object("pointer", test::pointerShape(), Vector3::Zero());
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const HandId hand = small.hand("right", pointer);
  small.pair(pointer, floor);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {0.0, 0.0, 0.05});
  test::moveHandTo(environment, hand, {0.0, 0.0, test::kPointerRadius - 0.02}, 200);
  test::stepTicks(environment, 20);

  const ObjectMotion& object = environment.objects()[pointer.value];
  EXPECT_NEAR(object.X_WO.translation().z(), test::kPointerRadius, 0.1e-3);
  EXPECT_TRUE(object.in_contact);
  EXPECT_TRUE(environment.objects()[floor.value].in_contact);
  EXPECT_TRUE(environment.inContact(floor, pointer));
  EXPECT_NEAR(environment.hands()[hand.value].F_Ho_W.force.z(), kStiffness * 0.02, 0.2);
  EXPECT_NEAR(environment.forceOn(pointer).force.z(), -kStiffness * 0.02, 0.2);
  EXPECT_NEAR(environment.forceOn(floor).force.z(), -kStiffness * 0.02, 0.2);

  PairContact contact;
  environment.pairContact(0, contact);
  EXPECT_TRUE(contact.colliding);
  EXPECT_NEAR(contact.F_Ao_W.force.z(), kStiffness * 0.02, 0.2);
  EXPECT_NEAR(contact.p_WP.z(), 0.0, 1e-3);
}

//   |  o
//   |   \    three faces meet: the pointer rests against all of them
//   |____v__
TEST(Environment, AnInnerCornerStopsThePointerAtAllThreeFaces) {
  test::SmallScene small;
  const ObjectId pointer = small.object("pointer", test::pointerShape(), Vector3::Zero());
  const ObjectId corner = small.object("corner", test::cornerStructures(0.12, 0.003), Vector3::Zero());
  const HandId hand = small.hand("right", pointer);
  small.pair(pointer, corner);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, Vector3::Constant(0.05));
  test::moveHandTo(environment, hand, {0.002, -0.003, 0.0}, 200);
  test::stepTicks(environment, 20);
  const Vector3 p = environment.objects()[pointer.value].X_WO.translation();
  EXPECT_NEAR(p.x(), test::kPointerRadius, 0.2e-3);
  EXPECT_NEAR(p.y(), test::kPointerRadius, 0.2e-3);
  EXPECT_NEAR(p.z(), test::kPointerRadius, 0.2e-3);
}

//      | |
//   ___|#|___     39.5 mm peg, 40 mm hole, hand 5 mm off to the side while it pushes down
//      |#|
//      |_|
TEST(Environment, APegGoesIntoItsHoleAndStaysBetweenTheWalls) {
  test::SmallScene small;
  const Vector3 size(0.0395, 0.0395, 0.1);
  const ObjectId peg = small.object("peg", test::boxStructures(size, 0.002, 0.004), Vector3::Zero());
  const ObjectId socket =
      small.object("socket", test::socketStructures({0.04, 0.04, 0.06}, 0.01, 0.0005), Vector3::Zero());
  const HandId hand = small.hand("right", peg);
  small.pair(peg, socket, false, 0.0001);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {0.0001, -0.0001, 0.06});
  test::moveHandTo(environment, hand, {0.0001, -0.0001, 0.045}, 100);
  double lateral = 0.0;
  for (const double z : {0.03, 0.01, -0.005, -0.03}) {
    test::moveHandTo(environment, hand, {0.005, 0.0, z}, 200);
    const Vector3& p = environment.objects()[peg.value].X_WO.translation();
    lateral = std::max(lateral, std::max(std::abs(p.x()), std::abs(p.y())));
    EXPECT_TRUE(environment.objects()[peg.value].in_contact);
  }
  test::stepTicks(environment, 100);
  const Pose& X_WP = environment.objects()[peg.value].X_WO;
  EXPECT_NEAR(X_WP.translation().z(), 0.05 - 0.06, 0.5e-3) << "at the bottom, tilted within the clearance";
  EXPECT_LT(lateral, 0.5 * 0.5e-3);
  // the hand is 20 mm deeper and 5 mm to the side
  EXPECT_NEAR(environment.hands()[hand.value].F_Ho_W.force.z(), kStiffness * 0.02, 1.0);
  EXPECT_NEAR(environment.hands()[hand.value].F_Ho_W.force.x(), -kStiffness * 0.005, 0.5);
}

//   |##|<- hand A     hand B ->|##|     pushed against each other: opposite coupling forces
TEST(Environment, TheInstructorsCubePushesAHeldPartWithEqualAndOppositeForces) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), Vector3::Zero());
  const ObjectId cube = small.object("cube", test::cubeShape(), Vector3::Zero());
  const HandId trainee = small.hand("right", part);
  const HandId instructor = small.hand("instructor", cube);
  small.pair(cube, part);
  Environment environment(small.build(), {});
  test::activateHand(environment, trainee, {0.0, 0.0, 0.0});
  test::activateHand(environment, instructor, {0.06, 0.0, 0.0});
  test::moveHandTo(environment, instructor, {0.03, 0.0, 0.0}, 200);
  test::stepTicks(environment, 50);

  // the centres are 40 mm apart in contact, the hands 30 mm: each of two equal couplings deflects by 5 mm
  const Vector3 on_trainee = environment.hands()[trainee.value].F_Ho_W.force;
  const Vector3 on_instructor = environment.hands()[instructor.value].F_Ho_W.force;
  EXPECT_NEAR(on_trainee.x(), -5.0, 0.1);
  EXPECT_NEAR(on_instructor.x(), 5.0, 0.1);
  EXPECT_LT((on_trainee + on_instructor).norm(), 1e-6);
  PairContact contact;
  environment.pairContact(0, contact);
  EXPECT_NEAR(contact.F_Ao_W.force.x(), 5.0, 0.1);
}

TEST(Environment, TwoHandsOnOneObjectAddTheirCouplingForces) {
  test::SmallScene small;
  const ObjectId left_pointer = small.object("left pointer", nullptr, Vector3::Zero());
  const ObjectId right_pointer = small.object("right pointer", nullptr, Vector3::Zero());
  const ObjectId part = small.object("part", test::cubeShape(), {0.0, 0.0, 0.5 * test::kCubeEdge + 1e-3});
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const HandId left = small.hand("left", left_pointer);
  const HandId right = small.hand("right", right_pointer);
  const std::size_t pair = small.pair(part, floor);
  Environment environment(small.build(), {});
  test::activateHand(environment, left, {-0.02, 0.0, 0.1});
  test::activateHand(environment, right, {0.02, 0.0, 0.1});
  environment.grab(left, part);
  environment.grab(right, part);
  for (int tick = 0; tick < 100; ++tick) {
    const double z = 0.1 - 0.011 * std::min(tick + 1, 80) / 80.0;
    environment.setHandPose(left, Pose(Vector3(-0.02, 0.0, z)), {});
    environment.setHandPose(right, Pose(Vector3(0.02, 0.0, z)), {});
    environment.step();
  }
  // goals 10 mm inside the floor, two couplings: 20 N on the floor, half of it at each hand
  PairContact contact;
  environment.pairContact(pair, contact);
  EXPECT_NEAR(contact.F_Ao_W.force.z(), 2.0 * kStiffness * 0.01, 0.2);
  EXPECT_NEAR(environment.hands()[left.value].F_Ho_W.force.z(), kStiffness * 0.01, 0.1);
  EXPECT_NEAR(environment.hands()[right.value].F_Ho_W.force.z(), kStiffness * 0.01, 0.1);
  EXPECT_NEAR(environment.forceOn(part).force.z(), -2.0 * kStiffness * 0.01, 0.2);
}

TEST(Environment, ASensingForearmDetectsContactAndExchangesNoForce) {
  test::SmallScene small;
  const ObjectId forearm = small.object("forearm", test::pointerShape(), {0.0, 0.0, 0.2});
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const HandId arm = small.hand("forearm", forearm, HandKind::kTracked);
  const std::size_t pair = small.pair(forearm, floor, true);
  Environment environment(small.build(), {});
  test::activateHand(environment, arm, {0.0, 0.0, 0.05});
  test::moveHandTo(environment, arm, {0.0, 0.0, 0.005}, 60);
  EXPECT_EQ(environment.objects()[forearm.value].X_WO.translation(),
            environment.hands()[arm.value].X_WH.translation());
  EXPECT_EQ(environment.objects()[forearm.value].status, ObjectStatus::kTracked);
  EXPECT_TRUE(environment.objects()[forearm.value].in_contact);
  EXPECT_FALSE(environment.objects()[floor.value].in_contact);
  PairContact contact;
  environment.pairContact(pair, contact);
  EXPECT_TRUE(contact.colliding);
  EXPECT_NEAR(contact.depth, test::kPointerRadius - 0.005, 1e-4);
  EXPECT_EQ(contact.F_Ao_W.force.norm(), 0.0);
  EXPECT_EQ(environment.hands()[arm.value].F_Ho_W.force.norm(), 0.0);
  EXPECT_EQ(environment.forceOn(floor).force.norm(), 0.0);
  HandManifold manifold;
  environment.manifold(arm, manifold);
  EXPECT_GT(manifold.contacts.size(), 0U);
}

TEST(Environment, ContactOfATrackedForearmThatMovesFarInOneTickIsDetected) {
  test::SmallScene small;
  const ObjectId forearm = small.object("forearm", test::pointerShape(), {0.0, 0.0, 0.2});
  const ObjectId floor = small.object("floor", test::floorShape(), Vector3::Zero());
  const HandId arm = small.hand("forearm", forearm, HandKind::kTracked);
  small.pair(forearm, floor, true);
  Environment environment(small.build(), {});
  test::activateHand(environment, arm, {0.0, 0.0, 0.25});
  test::stepTicks(environment, 5);
  environment.setHandPose(arm, Pose(Vector3(0.0, 0.0, 0.005)), {});
  environment.step();
  EXPECT_TRUE(environment.inContact(forearm, floor));
}

TEST(Environment, NoPointOfAHeldObjectExceedsTheSpeedCap) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), Vector3::Zero());
  const HandId hand = small.hand("right", part);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, Vector3::Zero());
  const double radius = 0.5 * test::kCubeEdge * std::numbers::sqrt3;
  environment.setHandPose(hand, Pose(Vector3(0.05, 0.0, 0.0), expRotation({0.0, 0.0, 1.0})), {});
  int ticks = 0;
  while (environment.objects()[part.value].X_WO.translation().x() < 0.0499 && ++ticks < 500) {
    environment.step();
    const Twist& V_WO = environment.objects()[part.value].V_WO;
    // the hand jumps in the first tick; then the object comes after it at 1 m/s
    const EnvironmentOptions caps;
    ASSERT_LE(V_WO.linear.norm() + V_WO.angular.norm() * radius,
              (ticks == 1 ? caps.max_speed + caps.max_turn_rate * radius : 1.0) + 1e-6);
  }
  EXPECT_GT(ticks, 50);
  EXPECT_LT(ticks, 200) << "the rest of the motion is made in the next ticks";
}

/// A cube whose mesh has its origin 2.5 m away, held in its middle.
struct DistantOrigin {
  DistantOrigin() {
    part = small.object(
        "part", test::boxStructuresAt(p_OC_O, Vector3::Constant(test::kCubeEdge), 0.002, 0.005), -p_OC_O);
    pointer = small.object("pointer", test::pointerShape(), Vector3(0.0, 0.0, 1.0));
    hand = small.hand("right", pointer);
  }
  const Vector3 p_OC_O{2.5, -1.3, 0.8};
  test::SmallScene small;
  ObjectId part, pointer;
  HandId hand;
};

TEST(Environment, ASlowTurnHasNoLagWhereverTheMeshHasItsOrigin) {
  DistantOrigin distant;
  Environment environment(distant.small.build(), {});
  test::activateHand(environment, distant.hand, Vector3::Zero());
  environment.grab(distant.hand, distant.part);
  const Vector3 axis = Vector3(0.0, 0.6, 0.8);
  for (int tick = 1; tick <= 1000; ++tick) {
    const Quaternion q_WH = expRotation(1e-3 * tick * axis);
    environment.setHandPose(distant.hand, Pose(Vector3::Zero(), q_WH), {});
    environment.step();
    const Pose& X_WO = environment.objects()[distant.part.value].X_WO;
    ASSERT_LT((X_WO * distant.p_OC_O).norm(), 1e-6) << tick;
    ASSERT_LT(logRotation(q_WH * X_WO.rotation().conjugate()).norm(), 1e-6) << tick;
    ASSERT_LT(environment.hands()[distant.hand.value].F_Ho_W.torque.norm(), 1e-4) << tick;
  }
}

TEST(Environment, AContributedTorqueIsLimitedAboutTheObjectsCentre) {
  DistantOrigin distant;
  Environment environment(distant.small.build(), {});
  test::activateHand(environment, distant.hand, Vector3::Zero());
  environment.grab(distant.hand, distant.part);
  // 20 N through the centre: 56 Nm about the origin
  const Vector3 f_W(0.0, 0.0, 20.0);
  for (int tick = 0; tick < 100; ++tick) {
    const Vector3 p_OC_W = environment.objects()[distant.part.value].X_WO.rotation() * distant.p_OC_O;
    environment.contribute(distant.part, 1, {f_W, p_OC_W.cross(f_W)}, 200);
    environment.step();
  }
  const Pose& X_WO = environment.objects()[distant.part.value].X_WO;
  EXPECT_NEAR((X_WO * distant.p_OC_O).z(), 20.0 / kStiffness, 0.2e-3);
  EXPECT_LT(logRotation(X_WO.rotation()).norm(), 1e-6) << "a force through the centre turns nothing";
}

TEST(Environment, AHiddenObjectIsTakenAtItsCentre) {
  DistantOrigin distant;
  distant.small.spec(distant.part).status = ObjectStatus::kHidden;
  Environment environment(distant.small.build(), {});
  test::activateHand(environment, distant.hand, Vector3(0.1, 0.2, 0.3));
  environment.grab(distant.hand, distant.part);
  environment.step();
  const Pose& X_WO = environment.objects()[distant.part.value].X_WO;
  EXPECT_LT((X_WO * distant.p_OC_O - Vector3(0.1, 0.2, 0.3)).norm(), 1e-6);
}

TEST(Environment, AContributionPushesAHeldObjectAgainstItsCoupling) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), Vector3::Zero());
  const HandId hand = small.hand("right", part);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, Vector3::Zero());
  for (int tick = 0; tick < 50; ++tick) {
    environment.contribute(part, 1, {Vector3(5.0, 0.0, 0.0), Vector3::Zero()}, 100);
    environment.step();
  }
  EXPECT_NEAR(environment.objects()[part.value].X_WO.translation().x(), 5.0 / kStiffness, 0.05e-3);
  EXPECT_NEAR(environment.hands()[hand.value].F_Ho_W.force.x(), 5.0, 0.1);
  test::stepTicks(environment, 250);
  EXPECT_NEAR(environment.objects()[part.value].X_WO.translation().x(), 0.0, 1e-9);
}

}  // namespace
}  // namespace tenon::simulation
