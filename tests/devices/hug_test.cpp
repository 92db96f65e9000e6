#include "devices/simulated/hug.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "devices/safety.h"

namespace tenon::devices {
namespace {

struct BothArms {
  DeviceState right, left;
};

BothArms cycle(Hug& hug, double right_force) {
  BothArms state;
  hug.right().read(state.right);
  hug.left().read(state.left);
  DeviceCommand command;
  hug.left().write(command);
  command.F_Ho_D.force.x() = right_force;
  hug.right().write(command);
  return state;
}

class HugClutch : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(hug_.open());
    ASSERT_TRUE(hug_.right().arm());
    ASSERT_TRUE(hug_.left().arm());
    // the person resists with full co-contraction
    hug_.right().humanArm().setContraction(1.0);
    hug_.left().humanArm().setIntent(Pose(Vector3(0.0, 0.1, 0.0)));
  }
  /// Ramps the force on the right hand until the clutch opens; returns the last force [N] on the hand.
  double pushUntilClutchOpens() {
    double force = 0.0;
    for (int tick = 0; tick < 2000 && !hug_.clutchOpen(); ++tick) {
      force = hug_.right().humanArm().handleWrench().force.norm();
      cycle(hug_, std::min(0.1 * tick, 120.0));
    }
    return force;
  }
  Hug hug_{3};
};

TEST_F(HugClutch, StaysClosedBelowEightyNewton) {
  for (int tick = 0; tick < 3000; ++tick) cycle(hug_, std::min(0.1 * tick, 75.0));
  EXPECT_FALSE(hug_.clutchOpen());
  EXPECT_NEAR(hug_.right().humanArm().handleWrench().force.norm(), 75.0, 1.0);
}

TEST_F(HugClutch, OpensAboveEightyNewtonAndStopsBothArms) {
  EXPECT_NEAR(pushUntilClutchOpens(), 80.0, 1.0);
  ASSERT_TRUE(hug_.clutchOpen());
  const BothArms stopped = cycle(hug_, 0.0);
  EXPECT_EQ(stopped.right.fault, DeviceFault::kClutchOpen);
  EXPECT_EQ(stopped.left.fault, DeviceFault::kClutchOpen);
  EXPECT_FALSE(stopped.right.forces_on);
  EXPECT_FALSE(stopped.left.forces_on);
  EXPECT_FALSE(hug_.left().arm()) << "the other arm, too, needs a reset";

  // the robots stand still, the hands move freely
  for (int tick = 0; tick < 1000; ++tick) cycle(hug_, 100.0);
  const BothArms later = cycle(hug_, 100.0);
  EXPECT_EQ(later.right.X_DH.translation(), stopped.right.X_DH.translation());
  EXPECT_EQ(later.left.X_DH.translation(), stopped.left.X_DH.translation());
  EXPECT_EQ(hug_.right().humanArm().handleWrench().force, Vector3(Vector3::Zero()));
  EXPECT_LT(hug_.right().humanArm().pose().translation().norm(), 1e-3) << "back at the intended pose";
}

TEST_F(HugClutch, ClosesOnlyAfterAReset) {
  pushUntilClutchOpens();
  cycle(hug_, 0.0);
  ASSERT_TRUE(hug_.right().resetFault());
  ASSERT_TRUE(hug_.left().resetFault());
  EXPECT_FALSE(hug_.clutchOpen());
  EXPECT_TRUE(hug_.right().arm());
  EXPECT_TRUE(hug_.left().arm());
  BothArms state;
  for (int tick = 0; tick < 2000; ++tick) state = cycle(hug_, 1.0);
  EXPECT_EQ(state.right.fault, DeviceFault::kNone);
  EXPECT_TRUE(state.right.forces_on);
  EXPECT_TRUE(state.left.forces_on);
  EXPECT_GT(hug_.right().humanArm().pose().translation().x(), 0.0) << "hand and handle are coupled again";
}

/// Both arms with their safety layers, as in a station.
class HugWithSafety : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(hug_.open());
    arm();
  }
  void arm() {
    ASSERT_TRUE(hug_.right().arm());
    ASSERT_TRUE(hug_.left().arm());
  }
  void cycle(const Vector3& force_right) {
    SafetyRequest request;
    DeviceState state;
    hug_.left().read(state);
    hug_.left().write(left_.step(request, state, 1e-3));
    if (left_.wantsDisarm()) hug_.left().disarm();
    hug_.right().read(state);
    request.requested.F_Ho_D.force = force_right;
    hug_.right().write(right_.step(request, state, 1e-3));
    if (right_.wantsDisarm()) hug_.right().disarm();
  }

  Hug hug_{3};
  ClutchLatch latch_;
  Safety right_{hug_.right().caps(), &latch_};
  Safety left_{hug_.left().caps(), &latch_};
};

TEST_F(HugWithSafety, NoRequestedForceOpensTheClutch) {
  hug_.right().humanArm().setContraction(1.0);
  for (int tick = 0; tick < 5000; ++tick) {
    cycle({1000.0, -1000.0, 300.0});
    EXPECT_LE(hug_.right().motorWrench().force.norm(), 50.0 + 1e-9);
  }
  EXPECT_FALSE(hug_.clutchOpen());
  EXPECT_TRUE(right_.acts(SafetyRule::kForceLimited));
}

// The pull of a person against the end stop exceeds the clutch force, which no command can.
TEST_F(HugWithSafety, APullAgainstTheEndStopOpensTheClutchStopsBothArmsAndAResetRestoresThem) {
  hug_.right().humanArm().setContraction(1.0);
  hug_.right().humanArm().setIntent(Pose(Vector3(0.0, 0.9, 0.0)));
  for (int tick = 0; tick < 3000; ++tick) cycle({0.0, 0.0, 0.0});
  ASSERT_TRUE(hug_.clutchOpen());
  EXPECT_TRUE(right_.acts(SafetyRule::kClutchOpen));
  EXPECT_TRUE(left_.acts(SafetyRule::kClutchOpen));
  EXPECT_EQ(hug_.left().phase(), SimulatedDevice::Phase::kFault);

  hug_.right().humanArm().setIntent(Pose::Identity());
  ASSERT_TRUE(hug_.right().resetFault());
  ASSERT_TRUE(hug_.left().resetFault());
  right_.reset();
  left_.reset();
  arm();
  for (int tick = 0; tick < 3000; ++tick) cycle({2.0, 0.0, 0.0});
  EXPECT_EQ(right_.flags(), 0U);
  EXPECT_EQ(hug_.right().phase(), SimulatedDevice::Phase::kArmed);
  EXPECT_EQ(hug_.left().phase(), SimulatedDevice::Phase::kArmed);
  EXPECT_NEAR(hug_.right().motorWrench().force.x(), 2.0, 1e-9);
}

}  // namespace
}  // namespace tenon::devices
