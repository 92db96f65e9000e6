#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::moveHandTo;
using test::stepTicks;

//   pointer o  [part]  [other]      two hands with a pointer each, two parts that may collide
class HandsTest : public testing::Test {
 protected:
  HandsTest() {
    pointer_ = small_.object("pointer", test::pointerShape(), {0.0, 0.0, 0.3});
    tool_ = small_.object("tool", test::pointerShape(), {0.0, 0.2, 0.3});
    part_ = small_.object("part", test::cubeShape(), {0.1, 0.0, 0.0});
    other_ = small_.object("other", test::cubeShape(), {0.3, 0.0, 0.0});
    right_ = small_.hand("right", pointer_);
    left_ = small_.hand("left", tool_);
    small_.pair(pointer_, part_);
    parts_ = small_.pair(part_, other_);
    environment_ = std::make_unique<Environment>(small_.build(), EnvironmentOptions{});
  }
  [[nodiscard]] const ObjectMotion& object(ObjectId id) const { return environment_->objects()[id.value]; }
  [[nodiscard]] const HandMotion& hand(HandId id) const { return environment_->hands()[id.value]; }

  test::SmallScene small_;
  ObjectId pointer_, tool_, part_, other_;
  HandId right_, left_;
  std::size_t parts_ = 0;
  std::unique_ptr<Environment> environment_;
};

TEST_F(HandsTest, APointerStaysParkedUntilItsHandHasAPose) {
  environment_->setHandPresent(right_, true);
  test::stepTicks(*environment_, 3);
  EXPECT_EQ(object(pointer_).status, ObjectStatus::kParked);
  EXPECT_EQ(object(pointer_).X_WO.translation(), Vector3(0.0, 0.0, 0.3));
  environment_->setHandPose(right_, Pose(Vector3(0.0, 0.1, 0.2)), {});
  environment_->step();
  EXPECT_EQ(object(pointer_).status, ObjectStatus::kHeld);
  EXPECT_EQ(object(pointer_).holder, right_);
  EXPECT_EQ(object(pointer_).X_WO.translation(), Vector3(0.0, 0.1, 0.2));
}

TEST_F(HandsTest, AGrabbedObjectKeepsItsPoseInTheHand) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  const std::uint32_t epoch = object(part_).epoch;
  environment_->grab(right_, part_);
  environment_->step();
  EXPECT_NEAR((object(part_).X_WO.translation() - Vector3(0.1, 0.0, 0.0)).norm(), 0.0, 1e-12);
  EXPECT_EQ(object(part_).epoch, epoch + 1);
  EXPECT_EQ(object(part_).status, ObjectStatus::kHeld);
  EXPECT_EQ(object(pointer_).status, ObjectStatus::kHidden);

  // a quarter turn of the hand about z moves the part about the hand
  const Quaternion turn = expRotation({0.0, 0.0, std::acos(0.0)});
  environment_->setHandPose(right_, Pose(Vector3(0.0, 0.0, 0.032), turn), {});
  test::stepTicks(*environment_, 300);
  EXPECT_NEAR((object(part_).X_WO.translation() - Vector3(0.0, 0.0, 0.0)).norm(), 0.0, 1e-6);
  EXPECT_NEAR(object(part_).X_WO.rotation().angularDistance(turn), 0.0, 1e-6);
}

TEST_F(HandsTest, ReleaseParksThePartAndTheHandMovesItsPointerAgain) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  environment_->grab(right_, part_);
  test::moveHandTo(*environment_, right_, {0.1, 0.1, 0.1}, 200);
  const Pose X_WP = object(part_).X_WO;
  environment_->release(right_);
  test::moveHandTo(*environment_, right_, {0.0, 0.0, 0.3}, 300);
  EXPECT_EQ(object(part_).X_WO, X_WP);
  EXPECT_EQ(object(part_).status, ObjectStatus::kParked);
  EXPECT_FALSE(object(part_).holder.valid());
  EXPECT_EQ(object(part_).V_WO.linear.norm(), 0.0);
  EXPECT_EQ(object(pointer_).status, ObjectStatus::kHeld);
  EXPECT_NEAR((object(pointer_).X_WO.translation() - Vector3(0.0, 0.0, 0.3)).norm(), 0.0, 1e-9);
}

TEST_F(HandsTest, AFixedPartStaysFixedAndTheHandMovesItsPointerAgain) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  for (const bool place_first : {true, false}) {
    environment_->grab(right_, part_);
    test::stepTicks(*environment_, 10);
    const Pose X_WG(Vector3(0.1, 0.1, 0.0));
    if (!place_first) environment_->release(right_);
    environment_->place(part_, X_WG, ObjectStatus::kFixed);
    if (place_first) {
      EXPECT_FALSE(hand(right_).object.valid());
      environment_->release(right_);
    }
    test::stepTicks(*environment_, 10);
    EXPECT_EQ(object(part_).X_WO, X_WG);
    EXPECT_EQ(object(part_).status, ObjectStatus::kFixed);
    EXPECT_EQ(hand(right_).object, pointer_);
    EXPECT_EQ(object(pointer_).status, ObjectStatus::kHeld);
  }
}

//   hand ->  o[part]     the pointer is in contact with the part, the hand 10 mm inside it; after the grab
//                        the other part stops the held one, and there the hand releases it
TEST_F(HandsTest, AfterAReleaseThePointerStartsOutsideThePartAndMovesToTheHand) {
  test::activateHand(*environment_, right_, {0.0, 0.0, 0.0});
  test::moveHandTo(*environment_, right_,
                   {0.1 - 0.5 * test::kCubeEdge - test::kPointerRadius + 0.01, 0.0, 0.0}, 100);
  test::stepTicks(*environment_, 20);
  const Vector3 p_PartPointer = object(pointer_).X_WO.translation() - object(part_).X_WO.translation();
  EXPECT_NEAR(p_PartPointer.x(), -0.5 * test::kCubeEdge - test::kPointerRadius, 1e-4);
  environment_->grab(right_, part_);
  test::moveHandTo(*environment_, right_, {0.25, 0.0, 0.0}, 300);
  test::stepTicks(*environment_, 20);
  const Vector3 p_WPart = object(part_).X_WO.translation();
  EXPECT_NEAR(p_WPart.x(), 0.3 - test::kCubeEdge, 0.1e-3);
  environment_->release(right_);
  environment_->place(part_, object(part_).X_WO, ObjectStatus::kFixed);
  EXPECT_LE((object(pointer_).X_WO.translation() - p_WPart - p_PartPointer).norm(), 1e-12);
  for (int tick = 0; tick < 100; ++tick) {
    environment_->step();
    const Vector3 p = object(pointer_).X_WO.translation() - p_WPart;
    ASSERT_LE(p.x(), -0.5 * test::kCubeEdge - test::kPointerRadius + 0.1e-3) << "outside";
    ASSERT_LE(object(pointer_).V_WO.linear.norm(), 1.0 + 1e-9);
  }
  test::moveHandTo(*environment_, right_, {0.0, 0.0, 0.2}, 500);
  EXPECT_NEAR((object(pointer_).X_WO.translation() - Vector3(0.0, 0.0, 0.2)).norm(), 0.0, 1e-9);
}

// A part in a hole lies deeper than its hand can be: what the hand moves next appears inside the part's
// surroundings.
TEST_F(HandsTest, APointerThatAppearsInsideAPartHasNoContactsUntilItIsOut) {
  const Vector3 inside(0.11, 0.0, 0.0);
  activateHand(*environment_, right_, inside);
  for (const double z : {0.0, 0.01, 0.0}) {
    moveHandTo(*environment_, right_, inside + Vector3(0.0, 0.0, z), 50);
    EXPECT_EQ(hand(right_).F_Ho_W.force, Vector3::Zero());
    EXPECT_FALSE(object(pointer_).in_contact);
    EXPECT_NEAR((object(pointer_).X_WO.translation() - hand(right_).X_WH.translation()).norm(), 0.0, 1e-4);
  }
  moveHandTo(*environment_, right_, {0.11, 0.0, 0.1}, 200);
  EXPECT_EQ(object(pointer_).X_WO.translation().z(), 0.1);
  moveHandTo(*environment_, right_, inside, 200);
  const double top = object(pointer_).X_WO.translation().z();
  EXPECT_NEAR(top, 0.02 + test::kPointerRadius, 2e-4) << "on the part, once it was out";
  EXPECT_NEAR(hand(right_).F_Ho_W.force.z(), hand(right_).stiffness.translational * top, 0.5);
}

// What is left of the overlap is a jump, so that stations ramp its force.
TEST_F(HandsTest, APointerThatComesOutSlowlyHasJumpedWhenItsContactsBegin) {
  activateHand(*environment_, right_, {0.11, 0.0, 0.0});
  stepTicks(*environment_, 3);
  const std::uint32_t inside = object(pointer_).epoch;
  for (double z = 0.0; z < 0.05 && !object(pointer_).in_contact; z += 0.0002) {
    EXPECT_EQ(object(pointer_).epoch, inside);
    moveHandTo(*environment_, right_, {0.11, 0.0, z}, 1);
  }
  ASSERT_TRUE(object(pointer_).in_contact);
  EXPECT_EQ(object(pointer_).epoch, inside + 1);
}

TEST_F(HandsTest, ACheckpointKnowsThatAPointerIsInsideAPart) {
  activateHand(*environment_, right_, {0.11, 0.0, 0.0});
  stepTicks(*environment_, 3);
  Environment restored(small_.build(), EnvironmentOptions{});
  ASSERT_TRUE(restored.restore(environment_->save()));
  EXPECT_EQ(restored.hash(), environment_->hash());
  for (Environment* environment : {environment_.get(), &restored}) {
    moveHandTo(*environment, right_, {0.11, 0.0, 0.01}, 20);
    EXPECT_EQ(environment->hands()[right_.value].F_Ho_W.force, Vector3::Zero());
  }
  EXPECT_EQ(restored.hash(), environment_->hash());
}

TEST_F(HandsTest, PlacingAPartAsHeldKeepsItInTheHandAtTheNewPose) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  environment_->grab(right_, part_);
  environment_->place(part_, Pose(Vector3(0.0, 0.0, 0.1)), ObjectStatus::kHeld);
  test::stepTicks(*environment_, 50);
  EXPECT_NEAR((object(part_).X_WO.translation() - Vector3(0.0, 0.0, 0.1)).norm(), 0.0, 1e-9);
  EXPECT_EQ(object(part_).holder, right_);
}

TEST_F(HandsTest, TheObjectOfAFrozenHandDoesNotMove) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  environment_->grab(right_, part_);
  environment_->step();
  environment_->setHandFrozen(right_, true);
  const Pose X_WP = object(part_).X_WO;
  test::moveHandTo(*environment_, right_, {0.1, 0.1, 0.1}, 100);
  EXPECT_EQ(object(part_).X_WO, X_WP);
  EXPECT_EQ(hand(right_).F_Ho_W.force.norm(), 0.0);
  environment_->setHandFrozen(right_, false);
  test::stepTicks(*environment_, 300);
  EXPECT_NEAR(object(part_).X_WO.translation().y(), 0.1, 1e-6);
}

TEST_F(HandsTest, AHandThatLeavesParksItsPartAndHoldsItAgainWhenItReturns) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.032});
  environment_->grab(right_, part_);
  test::moveHandTo(*environment_, right_, {0.1, 0.1, 0.1}, 200);
  const Pose X_WP = object(part_).X_WO;
  environment_->setHandPresent(right_, false);
  test::stepTicks(*environment_, 50);
  EXPECT_EQ(object(part_).status, ObjectStatus::kParked);
  EXPECT_EQ(object(part_).X_WO, X_WP);
  EXPECT_FALSE(object(part_).holder.valid());
  EXPECT_EQ(hand(right_).object, part_) << "to be held again when the hand is back";

  test::activateHand(*environment_, right_, {0.3, 0.3, 0.3});
  test::stepTicks(*environment_, 50);
  EXPECT_EQ(object(part_).status, ObjectStatus::kParked) << "the hand is elsewhere";
  test::moveHandTo(*environment_, right_, {0.1, 0.1, 0.1}, 200);
  EXPECT_EQ(object(part_).status, ObjectStatus::kHeld) << "it is where it held the part";
  EXPECT_LT((object(part_).X_WO.translation() - X_WP.translation()).norm(), 5e-3) << "the hand's last step";
}

TEST_F(HandsTest, WhenOneOfTwoHandsReleasesAPartTheOtherHoldsIt) {
  test::activateHand(*environment_, right_, {0.1, 0.05, 0.0});
  test::activateHand(*environment_, left_, {0.1, -0.05, 0.0});
  environment_->grab(left_, part_);
  environment_->grab(right_, part_);
  environment_->step();
  EXPECT_EQ(object(part_).holder, left_);
  environment_->release(left_);
  environment_->step();
  EXPECT_EQ(object(part_).holder, right_);
  EXPECT_EQ(object(part_).status, ObjectStatus::kHeld);
}

//   left o--[part]--o right      1000 N/m and 20 Nm/rad in each hand
class TwoHandsTest : public HandsTest {
 protected:
  TwoHandsTest() {
    test::activateHand(*environment_, right_, {0.1, 0.05, 0.0});
    test::activateHand(*environment_, left_, {0.1, -0.05, 0.0});
    environment_->grab(left_, part_);
    environment_->grab(right_, part_);
    environment_->step();
  }
};

TEST_F(TwoHandsTest, APartHeldByTwoHandsIsTwiceAsStiff) {
  constexpr std::uint32_t kLifetime = 100;
  for (int tick = 0; tick < 200; ++tick) {
    environment_->contribute(part_, 1, {Vector3(10.0, 0.0, 0.0), Vector3::Zero()}, kLifetime);
    environment_->step();
  }
  const double force = 10.0 * (1.0 - 1.0 / kLifetime);  // contributions are one tick old when applied
  EXPECT_NEAR(object(part_).X_WO.translation().x() - 0.1, force / 2000.0, 1e-6);
  EXPECT_NEAR(hand(right_).F_Ho_W.force.x(), 0.5 * force, 1e-3);
  EXPECT_NEAR(hand(left_).F_Ho_W.force.x(), 0.5 * force, 1e-3);
}

// two springs of 1000 N/m with lever arms of 50 mm, and two of 20 Nm/rad: 45 Nm/rad about z
TEST_F(TwoHandsTest, TorquesOfTwoHandsAddWithTheirLeverArms) {
  constexpr std::uint32_t kLifetime = 100;
  constexpr double kLever = 0.05;
  for (int tick = 0; tick < 200; ++tick) {
    environment_->contribute(part_, 1, {Vector3::Zero(), Vector3(0.0, 0.0, 0.2)}, kLifetime);
    environment_->step();
  }
  const double moment = 0.2 * (1.0 - 1.0 / kLifetime);
  const double angle = moment / (2.0 * 20.0 + 2.0 * 1000.0 * kLever * kLever);
  EXPECT_NEAR(displacement(Pose(), object(part_).X_WO).rotation.z(), angle, 1e-3 * angle);
  for (const HandId id : {right_, left_}) {
    EXPECT_NEAR(hand(id).F_Ho_W.torque.z(), 20.0 * angle, 0.01 * 20.0 * angle);
    EXPECT_NEAR(hand(id).F_Ho_W.force.norm(), 1000.0 * kLever * angle, 0.01 * 1000.0 * kLever * angle);
  }
}

TEST_F(TwoHandsTest, EachHandGetsTheForceOfTheOther) {
  test::moveHandTo(*environment_, right_, {0.1, 0.06, 0.0}, 100);
  test::stepTicks(*environment_, 100);
  EXPECT_NEAR(object(part_).X_WO.translation().y(), 0.005, 1e-6);
  EXPECT_NEAR(hand(right_).F_Ho_W.force.y(), -5.0, 1e-3);
  EXPECT_NEAR(hand(left_).F_Ho_W.force.y(), 5.0, 1e-3);
}

TEST_F(TwoHandsTest, AfterOneReleasesThePartKeepsItsEpochAndTheForceOnTheOtherFallsByAtMostANewtonPerTick) {
  test::moveHandTo(*environment_, right_, {0.1, 0.06, 0.0}, 100);
  test::stepTicks(*environment_, 100);
  const std::uint32_t epoch = object(part_).epoch;
  environment_->release(right_);
  constexpr double kLargestStep = 1.0;  // [N] 1000 N/m times the displacement per tick at 1 m/s
  for (int tick = 0; tick < 50; ++tick) {
    const Vector3 force = hand(left_).F_Ho_W.force;
    environment_->step();
    EXPECT_LE((hand(left_).F_Ho_W.force - force).norm(), kLargestStep + 1e-6);
  }
  EXPECT_EQ(object(part_).epoch, epoch);
  EXPECT_NEAR(hand(left_).F_Ho_W.force.norm(), 0.0, 1e-3);
}

// 1000 N/m over 50 ms and back between the two: 24 Ns/m leave 240 N/m
TEST_F(TwoHandsTest, OverLongLinksTwoHandsOnAPartAreSofterAndNoForceJumps) {
  test::moveHandTo(*environment_, right_, {0.1, 0.06, 0.0}, 100);
  test::stepTicks(*environment_, 100);
  ASSERT_NEAR(hand(left_).F_Ho_W.force.y(), 5.0, 1e-3);
  environment_->setHandRoundTrip(right_, 0.02);
  environment_->setHandRoundTrip(left_, 0.08);
  HandManifold manifold;
  for (int tick = 0; tick < 1000; ++tick) {
    const double before = hand(left_).F_Ho_W.force.y();
    environment_->step();
    ASSERT_LT(std::abs(hand(left_).F_Ho_W.force.y() - before), 0.03) << tick;
  }
  environment_->manifold(right_, manifold);
  EXPECT_NEAR(manifold.stiffness, 240.0, 1e-9);
  EXPECT_NEAR(manifold.rotational_stiffness, 4.8, 1e-9);
  ASSERT_EQ(manifold.others.size(), 1U);
  EXPECT_NEAR(manifold.others[0].stiffness, 240.0, 1e-9) << "the stations compute with the same springs";
  EXPECT_NEAR(hand(left_).F_Ho_W.force.y(), 1.2, 1e-3);
  EXPECT_NEAR(hand(right_).F_Ho_W.force.y(), -1.2, 1e-3);

  environment_->release(left_);
  test::stepTicks(*environment_, 2000);
  environment_->manifold(right_, manifold);
  EXPECT_EQ(manifold.stiffness, 1000.0) << "alone it is as stiff as its device";
}

TEST_F(HandsTest, AHandThatHoldsAPartAloneIsAsStiffOverALongLink) {
  test::activateHand(*environment_, right_, {0.1, 0.05, 0.0});
  test::activateHand(*environment_, left_, {0.3, -0.05, 0.0});
  environment_->setHandRoundTrip(right_, 0.2);
  environment_->setHandRoundTrip(left_, 0.2);
  environment_->grab(right_, part_);
  environment_->grab(left_, other_);
  test::stepTicks(*environment_, 100);
  EXPECT_EQ(environment_->couplingOf(right_).translational, 1000.0);
  EXPECT_EQ(environment_->couplingOf(left_).translational, 1000.0);
}

TEST_F(TwoHandsTest, ARoundTripThatIsNoNumberLimitsNothing) {
  for (const double none : {std::numeric_limits<double>::quiet_NaN(), -1.0, 0.0}) {
    environment_->setHandRoundTrip(right_, none);
    test::stepTicks(*environment_, 100);
    EXPECT_EQ(environment_->couplingOf(right_).translational, 1000.0) << none;
  }
}

TEST_F(TwoHandsTest, AFrozenHandLetsTheOtherMoveThePart) {
  test::stepTicks(*environment_, 10);
  environment_->setHandFrozen(left_, true);
  test::moveHandTo(*environment_, left_, {0.1, -0.25, 0.0}, 100);
  test::moveHandTo(*environment_, right_, {0.1, 0.15, 0.0}, 200);
  test::stepTicks(*environment_, 100);
  EXPECT_NEAR(object(part_).X_WO.translation().y(), 0.1, 1e-6) << "the right hand alone moves it";
  EXPECT_EQ(hand(left_).F_Ho_W.force.norm(), 0.0);
  HandManifold manifold;
  environment_->manifold(left_, manifold);
  EXPECT_TRUE(manifold.frozen);
  environment_->manifold(right_, manifold);
  EXPECT_FALSE(manifold.frozen);
  EXPECT_TRUE(manifold.others.empty()) << "the coupling of the frozen hand does not act";
}

TEST_F(TwoHandsTest, AHandThatWasFrozenHoldsThePartWhereTheOtherHasBroughtItWithoutAPull) {
  environment_->setHandFrozen(left_, true);
  test::moveHandTo(*environment_, right_, {0.1, 0.15, 0.0}, 200);
  test::stepTicks(*environment_, 100);
  const Pose X_WP = object(part_).X_WO;
  environment_->setHandFrozen(left_, false);
  for (int tick = 0; tick < 100; ++tick) {
    environment_->step();
    ASSERT_LT(hand(right_).F_Ho_W.force.norm(), 1e-3) << tick;
    ASSERT_LT(hand(left_).F_Ho_W.force.norm(), 1e-3) << tick;
  }
  EXPECT_NEAR((object(part_).X_WO.translation() - X_WP.translation()).norm(), 0.0, 1e-6);
  test::moveHandTo(*environment_, left_, {0.1, -0.04, 0.0}, 100);
  test::stepTicks(*environment_, 100);
  EXPECT_NEAR(hand(left_).F_Ho_W.force.y(), -5.0, 1e-2) << "its coupling acts again";
}

TEST_F(TwoHandsTest, AHandThatComesBackHoldsAPartOfAnotherHandWhereItHeldItAlone) {
  environment_->setHandPresent(left_, false);
  test::stepTicks(*environment_, 10);
  test::activateHand(*environment_, left_, {0.1, -0.3, 0.0});
  test::stepTicks(*environment_, 10);
  EXPECT_FALSE(hand(left_).attached) << "it is 25 cm away";
  test::moveHandTo(*environment_, left_, {0.1, -0.05, 0.0}, 100);
  EXPECT_TRUE(hand(left_).attached);
}

TEST_F(HandsTest, AHeldPartThatBeginsToCollideWhereItLiesInAnotherHasJumped) {
  environment_->setPairEnabled(parts_, false);
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.0});
  environment_->grab(right_, part_);
  test::moveHandTo(*environment_, right_, {0.275, 0.0, 0.0}, 200);
  test::stepTicks(*environment_, 20);
  const std::uint32_t epoch = object(part_).epoch;
  environment_->setPairEnabled(parts_, true);
  environment_->step();
  EXPECT_EQ(object(part_).epoch, epoch + 1);
  environment_->setPairEnabled(parts_, true);
  environment_->step();
  EXPECT_EQ(object(part_).epoch, epoch + 1) << "it collided already";
}

TEST_F(HandsTest, AHeldPartThatBeginsToCollideWithOneBesideItHasNotJumped) {
  environment_->setPairEnabled(parts_, false);
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.0});
  environment_->grab(right_, part_);
  test::moveHandTo(*environment_, right_, {0.255, 0.0, 0.0}, 200);
  test::stepTicks(*environment_, 20);
  const std::uint32_t epoch = object(part_).epoch;
  environment_->setPairEnabled(parts_, true);
  environment_->step();
  EXPECT_EQ(object(part_).epoch, epoch) << "5 mm are between them";
}

TEST_F(HandsTest, AHeldPartIntoWhichAnotherIsPutHasJumped) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.0});
  environment_->grab(right_, part_);
  environment_->step();
  const std::uint32_t epoch = object(part_).epoch;
  environment_->place(other_, Pose(Vector3(0.13, 0.0, 0.0)), ObjectStatus::kFixed);
  environment_->step();
  EXPECT_EQ(object(part_).epoch, epoch + 1);
}

TEST_F(HandsTest, SwappedHandsExchangeHeldAndDefaultObjects) {
  test::activateHand(*environment_, right_, {0.0, 0.0, 0.3});
  test::activateHand(*environment_, left_, {0.0, 0.2, 0.3});
  environment_->step();
  environment_->swapHands(right_, left_);
  environment_->step();
  EXPECT_EQ(hand(right_).object, tool_);
  EXPECT_EQ(hand(left_).object, pointer_);
  EXPECT_EQ(object(tool_).holder, right_);
  EXPECT_EQ(object(tool_).X_WO.translation(), Vector3(0.0, 0.0, 0.3));
  environment_->grab(left_, part_);
  environment_->release(left_);
  EXPECT_EQ(hand(left_).object, pointer_);
}

TEST_F(HandsTest, InvalidPosesAreIgnoredAndCounted) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.3});
  environment_->step();
  const std::uint64_t hash = environment_->hash();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  environment_->setHandPose(right_, Pose(Vector3(nan, 0.0, 0.0)), {});
  environment_->setHandPose(right_, Pose(Vector3::Zero(), Quaternion(nan, 0.0, 0.0, 0.0)), {});
  environment_->setHandPose(right_, Pose(Vector3::Zero(), Quaternion(0.0, 0.0, 0.0, 0.0)), {});
  environment_->setHandPose(right_, Pose(Vector3(1e200, 0.0, 0.0)), {});
  environment_->setHandPose(right_, Pose(), {Vector3(0.0, nan, 0.0), Vector3::Zero()});
  environment_->setHandPose(HandId{17}, Pose(), {});
  environment_->setHandPose(HandId{}, Pose(), {});
  EXPECT_EQ(environment_->hash(), hash);
  EXPECT_EQ(hand(right_).rejected_poses, 5U);
  test::stepTicks(*environment_, 5);
  EXPECT_TRUE(object(pointer_).X_WO.isFinite());
}

TEST_F(HandsTest, OnlyDiscontinuitiesIncrementTheEpoch) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.1});
  environment_->grab(right_, part_);
  std::uint32_t epoch = object(part_).epoch;
  test::moveHandTo(*environment_, right_, {0.1, 0.0, 0.2}, 200);
  EXPECT_EQ(object(part_).epoch, epoch);
  environment_->place(part_, Pose(), ObjectStatus::kParked);
  EXPECT_EQ(object(part_).epoch, ++epoch);
  environment_->grab(right_, part_);
  EXPECT_EQ(object(part_).epoch, ++epoch);
  environment_->release(right_);
  EXPECT_EQ(object(part_).epoch, ++epoch);
}

// The parts are 0.2 m apart and not held: the pair is never due until one part is placed next to the other.
TEST_F(HandsTest, ContactAfterPlacingAnObjectIsDetectedInTheNextTick) {
  test::stepTicks(*environment_, 100);
  EXPECT_FALSE(environment_->pairs()[parts_].queried);
  EXPECT_FALSE(environment_->inContact(part_, other_));
  environment_->place(part_, Pose(Vector3(0.3 - test::kCubeEdge, 0.0, 0.0)), ObjectStatus::kFixed);
  environment_->step();
  EXPECT_TRUE(environment_->pairs()[parts_].queried);
  EXPECT_TRUE(environment_->inContact(part_, other_));
  test::stepTicks(*environment_, 10);
  EXPECT_TRUE(object(other_).in_contact) << "contacts of unmoved objects stay without queries";
  environment_->place(part_, Pose(), ObjectStatus::kHidden);
  environment_->step();
  EXPECT_FALSE(environment_->inContact(part_, other_));
}

TEST_F(HandsTest, ObjectsOfADisabledPairDoNotCollide) {
  test::activateHand(*environment_, right_, {0.1, 0.0, 0.0});
  environment_->grab(right_, part_);
  environment_->setPairEnabled(parts_, false);
  test::moveHandTo(*environment_, right_, {0.3, 0.0, 0.0}, 400);
  EXPECT_NEAR(object(part_).X_WO.translation().x(), 0.3, 1e-9);
  EXPECT_FALSE(environment_->inContact(part_, other_));
  test::moveHandTo(*environment_, right_, {0.1, 0.0, 0.0}, 400);
  environment_->setPairEnabled(parts_, true);
  test::moveHandTo(*environment_, right_, {0.3, 0.0, 0.0}, 400);
  EXPECT_NEAR(object(part_).X_WO.translation().x(), 0.3 - test::kCubeEdge, 0.1e-3);
  EXPECT_TRUE(environment_->inContact(part_, other_));
}

TEST(Environment, ObjectsOfOneGroupDoNotCollide) {
  test::SmallScene small;
  const ObjectId part = small.object("part", test::cubeShape(), {0.1, 0.0, 0.0}, ObjectStatus::kParked, 1);
  const ObjectId other = small.object("other", test::cubeShape(), {0.2, 0.0, 0.0}, ObjectStatus::kParked, 1);
  const HandId right = small.hand("right", part);
  small.pair(part, other);
  Environment environment(small.build(), {});
  test::activateHand(environment, right, {0.1, 0.0, 0.0});
  test::moveHandTo(environment, right, {0.2, 0.0, 0.0}, 200);
  EXPECT_NEAR(environment.objects()[part.value].X_WO.translation().x(), 0.2, 1e-9);
  EXPECT_FALSE(environment.inContact(part, other));
}

}  // namespace
}  // namespace tenon::simulation
