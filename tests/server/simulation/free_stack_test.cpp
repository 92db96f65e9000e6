#include <cmath>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/support/realtime_guard.h"

namespace tenon::simulation {
namespace {

using test::activateHand;
using test::moveHandTo;
using test::stepTicks;

constexpr double kEdge = 0.05;
constexpr double kBoxMass = 0.4;

//   [2]
//   [1]        three boxes with gaps of 0.1 mm; a pointer that can push them
//   [0]   o
//  ~~~~~~~~~
class StackTest : public testing::Test {
 protected:
  StackTest() {
    const ObjectId ground = small_.object("ground", test::floorShape(), Vector3::Zero());
    for (int i = 0; i < 3; ++i) {
      boxes_[i] = small_.freeBox("box" + std::to_string(i), Vector3::Constant(kEdge), kBoxMass,
                                 {0.002 * i, 0.001 * i, (i + 0.5) * kEdge + 1e-4 * (i + 1)});
      small_.pair(boxes_[i], ground);
      small_.spec(boxes_[i]).body->friction = 0.4;
      for (int j = 0; j < i; ++j) small_.pair(boxes_[i], boxes_[j]);
    }
    pointer_ = small_.object("pointer", test::pointerShape(), {0.3, 0.0, 0.1});
    hand_ = small_.hand("hand", pointer_);
    for (const ObjectId box : boxes_) small_.pair(pointer_, box);
    begin({});
  }
  void begin(const EnvironmentOptions& options) {
    environment_ = std::make_unique<Environment>(small_.build(), options);
  }
  [[nodiscard]] const ObjectMotion& box(int i) const { return environment_->objects()[boxes_[i].value]; }
  [[nodiscard]] bool allAsleep() const { return box(0).asleep && box(1).asleep && box(2).asleep; }

  test::SmallScene small_;
  std::array<ObjectId, 3> boxes_;
  ObjectId pointer_;
  HandId hand_;
  std::unique_ptr<Environment> environment_;
};

TEST_F(StackTest, AStackOfThreeComesToRestAndSleeps) {
  test::stepTicks(*environment_, 20);
  std::array<Pose, 3> before;
  for (int i = 0; i < 3; ++i) before[i] = box(i).X_WO;
  int tick = 0;
  for (; tick < 10'000 && !allAsleep(); ++tick) environment_->step();
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(allAsleep());
  for (int i = 0; i < 3; ++i) {
    EXPECT_LE((box(i).X_WO.translation() - before[i].translation()).norm(), 10e-6) << i;
    EXPECT_NEAR(box(i).X_WO.translation().z(), (i + 0.5) * kEdge, (i + 1) * 5e-5);
    before[i] = box(i).X_WO;
  }
  test::stepTicks(*environment_, 10'000);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(box(i).X_WO, before[i]) << "a sleeping body does not move at all";
  EXPECT_EQ(environment_->work().queried_pairs, 0U) << "sleeping bodies need no queries";
}

TEST_F(StackTest, AStackDroppedTiltedComesToRest) {
  for (const double yaw : {0.1, 0.5}) {
    begin({});
    for (int i = 0; i < 3; ++i) {
      const Quaternion tilted = expRotation({0.03 * (i + 1), 0.07, 0.3 * i + yaw});
      const Vector3 p(0.002 * i, 0.001 * i, (i + 0.5) * kEdge + 5.2e-3 * (i + 1));
      environment_->place(boxes_[i], Pose(p, tilted), ObjectStatus::kFree);
    }
    for (int tick = 0; tick < 1000 && !allAsleep(); ++tick) environment_->step();
    ASSERT_TRUE(allAsleep()) << yaw;
    std::array<Pose, 3> rest;
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(box(i).X_WO.translation().z(), (i + 0.5) * kEdge, (i + 1) * 5e-5);
      EXPECT_LE((box(i).X_WO.rotation() * Vector3::UnitZ() - Vector3::UnitZ()).norm(), 1e-3);
      rest[i] = box(i).X_WO;
    }
    test::stepTicks(*environment_, 10'000);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(box(i).X_WO, rest[i]);
  }
}

TEST_F(StackTest, ContactForcesInAStackBalanceTheWeights) {
  test::stepTicks(*environment_, 500);
  ASSERT_TRUE(allAsleep());
  for (int i = 0; i < 3; ++i) {
    PairContact contact;
    const int pair = environment_->scene().pairOf(boxes_[i], i == 0 ? ObjectId{0} : boxes_[i - 1]);
    environment_->pairContact(static_cast<std::size_t>(pair), contact);
    EXPECT_NEAR(contact.F_Ao_W.force.z(), (3 - i) * kBoxMass * 9.81, 0.02 * kBoxMass * 9.81) << i;
    EXPECT_NEAR(environment_->forceOn(boxes_[i]).force.norm(), 0.0, 0.05) << "weight and contacts cancel";
  }
}

TEST_F(StackTest, AHandWakesAndPushesASleepingBoxItTouches) {
  test::stepTicks(*environment_, 500);
  ASSERT_TRUE(allAsleep());
  test::activateHand(*environment_, hand_, {0.2, 0.0, 2.5 * kEdge});
  test::stepTicks(*environment_, 10);
  EXPECT_TRUE(allAsleep()) << "the hand is 150 mm away";
  test::moveHandTo(*environment_, hand_, {0.02, 0.0, 2.5 * kEdge}, 500);
  EXPECT_FALSE(box(2).asleep);
  EXPECT_LT(box(2).X_WO.translation().x(), -0.005);
}

TEST_F(StackTest, SleepingBoxesFallWhenTheirSupportIsRemoved) {
  test::stepTicks(*environment_, 500);
  ASSERT_TRUE(allAsleep());
  environment_->place(boxes_[0], Pose(Vector3(0.3, 0.3, 0.5 * kEdge)), ObjectStatus::kFree);
  test::stepTicks(*environment_, 1000);
  EXPECT_NEAR(box(1).X_WO.translation().z(), 0.5 * kEdge, 1e-4);
  EXPECT_NEAR(box(2).X_WO.translation().z(), 1.5 * kEdge, 1e-4);
  EXPECT_TRUE(allAsleep());
}

TEST_F(StackTest, ASleepingBoxFallsWhenThePairWithItsSupportIsDisabled) {
  test::stepTicks(*environment_, 500);
  ASSERT_TRUE(allAsleep());
  environment_->setPairEnabled(static_cast<std::size_t>(environment_->scene().pairOf(boxes_[0], ObjectId{0})),
                               false);
  test::stepTicks(*environment_, 100);
  EXPECT_LT(box(0).X_WO.translation().z(), 0.4 * kEdge);
}

TEST_F(StackTest, IsBitEqualForAnyNumberOfWorkersAndWithoutCoherence) {
  EnvironmentOptions options;
  const auto play = [&](double ticks) {
    begin(options);
    std::vector<std::uint64_t> hashes;
    test::activateHand(*environment_, hand_, {0.2, 0.0, 1.5 * kEdge});
    for (int tick = 0; tick < 900; ++tick) {
      const double x = 0.2 - 0.25 * std::min(1.0, tick / ticks);
      environment_->setHandPose(hand_, Pose(Vector3(x, 0.0, 1.5 * kEdge)), {});
      environment_->step();
      hashes.push_back(environment_->hash());
    }
    return hashes;
  };
  for (const double ticks : {600.0, 200.0}) {
    options = {};
    const auto expected = play(ticks);
    const std::array last{box(0).X_WO, box(1).X_WO, box(2).X_WO};
    for (const unsigned workers : {2U, 4U}) {
      options.workers = workers;
      EXPECT_EQ(play(ticks), expected) << workers;
    }
    options = {};
    options.coherence = false;
    play(ticks);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(box(i).X_WO, last[i]) << "pushed within " << ticks << " ticks";
  }
}

TEST_F(StackTest, ContinuesBitEqualAfterARestore) {
  test::activateHand(*environment_, hand_, {0.2, 0.0, 1.5 * kEdge});
  test::moveHandTo(*environment_, hand_, {0.03, 0.0, 1.5 * kEdge}, 300);
  const std::vector<std::uint8_t> bytes = environment_->save();
  Environment other(small_.build(), {});
  ASSERT_TRUE(other.restore(bytes));
  EXPECT_EQ(other.hash(), environment_->hash());
  for (int tick = 0; tick < 300; ++tick) {
    for (Environment* one : {environment_.get(), &other}) {
      one->setHandPose(hand_, Pose(Vector3(0.03 - 1e-4 * tick, 0.0, 1.5 * kEdge)), {});
      one->step();
    }
    ASSERT_EQ(other.hash(), environment_->hash()) << tick;
  }
}

TEST_F(StackTest, NoCheckpointExceedsTheBoundOnItsSize) {
  const std::size_t most = environment_->maxSavedBytes();
  test::activateHand(*environment_, hand_, {0.2, 0.0, 1.5 * kEdge});
  test::moveHandTo(*environment_, hand_, {0.03, 0.0, 1.5 * kEdge}, 300);
  EXPECT_GT(environment_->save().size(), 20'000U) << "full lists";
  EXPECT_LE(environment_->save().size(), most);
}

TEST_F(StackTest, ContinuesBitEqualAfterARestoreWhenASeparatedPairComesNearAgain) {
  test::stepTicks(*environment_, 100);
  environment_->place(boxes_[2], Pose(Vector3(0.5, 0.5, 0.5)), ObjectStatus::kParked);
  test::stepTicks(*environment_, 10);
  const std::vector<std::uint8_t> bytes = environment_->save();
  Environment other(small_.build(), {});
  ASSERT_TRUE(other.restore(bytes));
  for (Environment* one : {environment_.get(), &other}) {
    one->place(boxes_[2], Pose(Vector3(0.004, 0.002, 2.5 * kEdge + 1e-4)), ObjectStatus::kParked);
    test::stepTicks(*one, 5);
    one->place(boxes_[2], Pose(Vector3(0.004, 0.002, 2.5 * kEdge + 1e-4)), ObjectStatus::kFree);
    test::stepTicks(*one, 20);
  }
  EXPECT_EQ(other.hash(), environment_->hash());
}

TEST_F(StackTest, StepAllocatesNothingAndLocksNothing) {
  EnvironmentOptions options;
  options.workers = 2;
  begin(options);
  test::activateHand(*environment_, hand_, {0.2, 0.0, 1.5 * kEdge});
  test::stepTicks(*environment_, 50);
  const test::RealtimeGuard guard(test::CountedThreads::kAll);
  test::moveHandTo(*environment_, hand_, {0.0, 0.0, 1.5 * kEdge}, 400);
  test::stepTicks(*environment_, 400);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::simulation
