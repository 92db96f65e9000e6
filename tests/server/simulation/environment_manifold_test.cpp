#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/motion_solver.h"
#include "server/simulation/environment.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::kCubeEdge;
using test::moveHandTo;
using test::stepTicks;

/// [m] Gap of a listed contact for poses of the two bodies, as a client computes it.
double gapOf(const ManifoldContact& contact, const Pose& X_WO, const Pose& X_WA) {
  const Vector3 p_AP = X_WA.inverse() * (X_WO * Vector3(contact.p_BoP_B.cast<double>()));
  return contact.normal_A.cast<double>().dot(p_AP) - static_cast<double>(contact.offset);
}

//    |##|      a held cube comes down on a floor whose frame differs from the world frame
//   ~~~~~~
class ManifoldTest : public testing::Test {
 protected:
  ManifoldTest() {
    part_ = small_.object("part", test::cubeShape(), {0.0, 0.0, 0.1});
    floor_ = small_.object("floor", test::floorShape(), {0.05, 0.02, 0.0});
    hand_ = small_.hand("right", part_);
    small_.pair(part_, floor_);
    environment_ = std::make_unique<Environment>(small_.build(), EnvironmentOptions{});
    test::activateHand(*environment_, hand_, {0.0, 0.0, 0.1});
  }
  test::SmallScene small_;
  ObjectId part_, floor_;
  HandId hand_;
  std::unique_ptr<Environment> environment_;
  HandManifold manifold_;
};

TEST_F(ManifoldTest, ListsContactsAheadWithSignedGaps) {
  test::moveHandTo(*environment_, hand_, {0.0, 0.0, 0.5 * test::kCubeEdge + 0.4e-3}, 400);
  test::stepTicks(*environment_, 20);
  environment_->manifold(hand_, manifold_);
  ASSERT_GE(manifold_.contacts.size(), 4U) << "the corners at least";
  EXPECT_EQ(manifold_.object, part_);
  EXPECT_EQ(manifold_.tick, environment_->tick());
  EXPECT_FALSE(environment_->objects()[part_.value].in_contact);
  for (const ManifoldContact& contact : manifold_.contacts) {
    EXPECT_EQ(contact.other, floor_);
    EXPECT_NEAR(contact.gap, 0.4e-3, 0.02e-3);
    EXPECT_NEAR(contact.normal_A.z(), 1.0, 1e-3);
    EXPECT_NEAR(gapOf(contact, manifold_.X_WO, environment_->objects()[floor_.value].X_WO), contact.gap,
                1e-6);
  }
}

TEST_F(ManifoldTest, ListsContactsOfAFastObjectFartherAhead) {
  const Vector3 near(0.0, 0.0, 0.5 * test::kCubeEdge + 2.2e-3);
  const Vector3 away(0.0, 0.0, 0.5 * test::kCubeEdge + 0.08);
  test::moveHandTo(*environment_, hand_, near, 4000);
  environment_->manifold(hand_, manifold_);
  EXPECT_EQ(manifold_.contacts.size(), 0U) << "at 20 mm/s, 2.2 mm are beyond the look-ahead";
  test::moveHandTo(*environment_, hand_, away, 200);
  test::moveHandTo(*environment_, hand_, near, 200);
  environment_->manifold(hand_, manifold_);
  EXPECT_GE(manifold_.contacts.size(), 4U) << "0.4 m/s";
}

TEST_F(ManifoldTest, ContainsTheCouplingWrenchAboutTheHand) {
  environment_->release(hand_);
  test::moveHandTo(*environment_, hand_, {0.0, 0.0, 0.5 * test::kCubeEdge - 0.005}, 400);
  test::stepTicks(*environment_, 20);
  environment_->manifold(hand_, manifold_);
  EXPECT_NEAR(manifold_.F_Ho_W.force.z(), 1000.0 * 0.005, 0.1);
  EXPECT_NEAR(manifold_.F_Ho_W.torque.norm(), 0.0, 0.01);
  EXPECT_EQ(manifold_.stiffness, 1000.0);
  environment_->setHandStiffness(hand_, {4000.0, 7.0});
  test::stepTicks(*environment_, 20);
  environment_->manifold(hand_, manifold_);
  EXPECT_NEAR(manifold_.F_Ho_W.force.z(), 4000.0 * 0.005, 0.4);
  EXPECT_EQ(manifold_.stiffness, 4000.0);
  EXPECT_EQ(manifold_.rotational_stiffness, 7.0);
  EXPECT_LE(manifold_.validity_radius, 1.1e-3);
}

//   [######]   the held plate is the SDF side, the cube below it the pointshell side:
//     |##|     the half-spaces have to be the same
TEST(Manifold, HasTheSameConventionsWhenTheHeldBodyIsTheSdfSide) {
  test::SmallScene small;
  const ObjectId held =
      small.object("held", test::boxStructures({0.1, 0.1, test::kCubeEdge}, 0.002, 0.01), {0.0, 0.0, 0.1});
  const ObjectId still = small.object("still", test::cubeShape(), Vector3::Zero());
  const HandId hand = small.hand("right", held);
  small.pair(still, held);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {0.0, 0.0, 0.1});
  test::moveHandTo(environment, hand, {0.0, 0.0, test::kCubeEdge - 0.003}, 400);
  test::stepTicks(environment, 20);
  HandManifold manifold;
  environment.manifold(hand, manifold);
  ASSERT_GE(manifold.contacts.size(), 4U);
  const Pose X_WA = environment.objects()[still.value].X_WO;
  for (const ManifoldContact& contact : manifold.contacts) {
    EXPECT_NEAR(contact.normal_A.z(), 1.0, 1e-2);
    EXPECT_NEAR(gapOf(contact, manifold.X_WO, X_WA), contact.gap, 1e-6);
    Pose raised = manifold.X_WO;
    raised.translation().z() += 0.01;
    EXPECT_NEAR(gapOf(contact, raised, X_WA), contact.gap + 0.01, 1e-4) << "gaps are positive when apart";
  }
  EXPECT_NEAR(manifold.F_Ho_W.force.z(), 3.0, 0.1);
}

TEST(Manifold, ContainsTheVelocityOfTheOtherBody) {
  test::SmallScene small;
  const ObjectId held = small.object("held", test::cubeShape(), Vector3::Zero());
  const ObjectId cube = small.object("cube", test::cubeShape(), {0.1, 0.0, 0.0});
  const HandId right = small.hand("right", held);
  const HandId instructor = small.hand("instructor", cube);
  small.pair(cube, held);
  Environment environment(small.build(), {});
  test::activateHand(environment, right, Vector3::Zero());
  test::activateHand(environment, instructor, {0.1, 0.0, 0.0});
  test::moveHandTo(environment, instructor, {test::kCubeEdge + 0.0005, 0.0, 0.0}, 297);  // 0.2 m/s
  HandManifold manifold;
  environment.manifold(right, manifold);
  ASSERT_GT(manifold.contacts.size(), 0U);
  for (const ManifoldContact& contact : manifold.contacts) {
    EXPECT_NEAR(contact.velocity_W.x(), -0.2, 0.01);
    EXPECT_NEAR(contact.velocity_W.tail<2>().norm(), 0.0, 0.01);
  }
  ASSERT_EQ(manifold.bodies.size(), 1U);
  EXPECT_EQ(manifold.bodies[0].object, cube);
  EXPECT_EQ(manifold.bodies[0].epoch, environment.objects()[cube.value].epoch);
  EXPECT_GT(manifold.bodies[0].epoch, 0U);
}

/// [m] By how much a station's problem, of the object, the hand's spring and the listed planes, moves any
/// point of the object.
double stationMoves(const Environment& environment, HandId hand) {
  HandManifold manifold;
  environment.manifold(hand, manifold);
  collision::MovableBody body;
  body.X_WB = manifold.X_WO;
  body.radius = std::sqrt(0.75) * kCubeEdge;
  body.springs.push_back({environment.hands()[hand.value].X_WH * manifold.X_HO,
                          manifold.X_HO.inverse().translation(), manifold.stiffness,
                          manifold.rotational_stiffness});
  std::vector<collision::ContactConstraint> planes;
  for (const ManifoldContact& contact : manifold.contacts) {
    const Pose& X_WA = environment.objects()[contact.other.value].X_WO;
    planes.push_back({.body_a = 0,
                      .n_W = X_WA.rotation() * contact.normal_A.cast<double>(),
                      .p_WP = manifold.X_WO * contact.p_BoP_B.cast<double>(),
                      .gap = gapOf(contact, manifold.X_WO, X_WA)});
  }
  collision::MotionSolver solver(1, kManifoldContacts);
  std::vector<Displacement> motion(1);
  solver.solve({&body, 1}, planes, motion, {});
  return maxPointMotion(motion[0], body.radius);
}

//   | |##||   a cube lies flush in a corner, 0.2 mm from two further walls, and the hand goes to and fro and
//   |~~~~~|   turns: hundreds of contacts within the margin, of which a few hold the cube
TEST(Manifold, ListsTheContactsThatHoldTheObject) {
  test::SmallScene small;
  constexpr double kThick = 0.03, kPlay = 2e-4;  // [m]
  constexpr double kAway = 0.5 * (kCubeEdge + kThick);
  const ObjectId held = small.object("held", test::cubeShape(), Vector3::Zero());
  const HandId hand = small.hand("right", held);
  for (const Vector3& side : {Vector3(0.0, 0.0, -1.0), Vector3(1.0, 0.0, 0.0), Vector3(-1.0, 0.0, 0.0),
                              Vector3(0.0, 1.0, 0.0), Vector3(0.0, -1.0, 0.0)}) {
    const double play = side.sum() < 0.0 && side.z() == 0.0 ? kPlay : 0.0;
    const Vector3 size = Vector3::Constant(0.1) + (kThick - 0.1) * side.cwiseAbs();
    small.pair(held, small.object("wall " + std::to_string(side.dot(Vector3(1.0, 2.0, 3.0))),
                                  test::boxShape(size), (kAway + play) * side));
  }
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, Vector3::Zero());
  double largest = 0.0;
  for (int tick = 0; tick < 300; ++tick) {
    const double angle = 0.03 * tick, grows = std::min(1.0, 0.01 * tick);
    const Vector3 goal(0.001 * std::sin(angle), 0.001 * std::cos(angle), -0.001);
    environment.setHandPose(
        hand, Pose(grows * goal, expRotation({0.02 * grows * std::sin(1.3 * angle), 0.0, 0.0})), {});
    environment.step();
    largest = std::max(largest, stationMoves(environment, hand));
  }
  EXPECT_GT(environment.hands()[hand.value].F_Ho_W.force.norm(), 1.0);
  EXPECT_LT(largest, 3.0 * collision::kSettleTolerance);
}

//   <> <>   a bar beside the end of another one: their edges pass each other, and cross when the hand goes
//   ----    back by the 0.4 mm between them
TEST(Manifold, IsValidAsFarAsACrossingThatMayComeAbout) {
  const Vector3 beside(0.0, 0.0304, 2.0 * test::kBarEdge - 0.0001);
  test::SmallScene small;
  const ObjectId held = small.object("held", test::barShape(Vector3::UnitX()), beside);
  const ObjectId still = small.object("still", test::barShape(Vector3::UnitY()), Vector3::Zero());
  const HandId hand = small.hand("right", held);
  small.pair(held, still);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, beside);
  test::stepTicks(environment, 20);
  HandManifold manifold;
  environment.manifold(hand, manifold);
  ASSERT_FALSE(environment.objects()[held.value].in_contact);
  EXPECT_LE(manifold.validity_radius, std::hypot(0.0004, 0.0001) + 1e-6);
  EXPECT_GT(manifold.validity_radius, 0.00005);
  for (const ManifoldContact& contact : manifold.contacts) EXPECT_LT(contact.gap, 0.001);
}

//   [held]  [near]   [middle]        [far]      each in a hand of its own; the table has two places
TEST(Manifold, ListsTheNearestHandsThatHoldObjectsCloseBy) {
  test::SmallScene small;
  const double reach = std::sqrt(3.0) * test::kCubeEdge + kNeighbourReach;  // [m] between centres
  std::vector<HandId> hands;
  std::vector<ObjectId> objects;
  std::vector<Vector3> places;
  for (const double x : {0.0, 0.9 * reach, 1.1 * reach, -0.5 * reach, 0.95 * reach}) {
    places.emplace_back(x, 0.0, 0.0);
    const std::string name = "cube " + std::to_string(places.size());
    objects.push_back(small.object(name, test::cubeShape(), places.back()));
    hands.push_back(small.hand("hand " + std::to_string(places.size()), objects.back()));
  }
  small.pair(objects[0], objects[1]);
  Environment environment(small.build(), {});
  for (std::size_t i = 0; i < hands.size(); ++i) test::activateHand(environment, hands[i], places[i]);
  const Twist V_WH{Vector3(0.1, 0.0, 0.0), Vector3::Zero()};
  environment.setHandPose(hands[3], Pose(places[3]), V_WH);
  environment.step();
  HandManifold manifold;
  environment.manifold(hands[0], manifold);
  ASSERT_EQ(manifold.others.size(), 2U);
  EXPECT_EQ(manifold.others[0].hand, hands[3]);
  EXPECT_EQ(manifold.others[0].object, objects[3]);
  EXPECT_NEAR((manifold.others[0].X_WG.translation() - places[3]).norm(), 0.0, 1e-9);
  EXPECT_NEAR(manifold.others[0].V_WG[0], 0.1, 1e-6);
  EXPECT_EQ(manifold.others[1].hand, hands[1]);

  environment.setHandPresent(hands[3], false);
  environment.setHandFrozen(hands[1], true);
  environment.step();
  environment.manifold(hands[0], manifold);
  ASSERT_EQ(manifold.others.size(), 1U) << "who is absent or held still does not pull";
  EXPECT_EQ(manifold.others[0].hand, hands[4]);
}

TEST(Manifold, IsEmptyButWellFormedForAHandWithoutObject) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), Vector3::Zero());
  const HandId hand = small.hand("right", part);
  Environment environment(small.build(), {});
  environment.place(part, Pose(), ObjectStatus::kFixed);
  environment.step();
  HandManifold manifold;
  environment.manifold(hand, manifold);
  EXPECT_FALSE(manifold.object.valid());
  EXPECT_EQ(manifold.contacts.size(), 0U);
}

}  // namespace
}  // namespace tenon::simulation
