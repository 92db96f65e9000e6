#include "devices/drivers/browser_device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/realtime_guard.h"

namespace tenon::devices {
namespace {

/// A target at `p`, turned by `angle` about z, with its person at the page.
RemoteTarget targetAt(const Vector3& p, double angle = 0.0) {
  RemoteTarget target;
  target.buttons = kRemoteHeld;
  target.X_DT = Pose(p, Quaternion(Eigen::AngleAxisd(angle, Vector3::UnitZ())));
  return target;
}

class BrowserDeviceTest : public testing::Test {
 protected:
  /// Cycles in which the browser says the same again and again, as pages do.
  DeviceState led(int count, const RemoteTarget& target) {
    DeviceState state;
    for (int i = 0; i < count; ++i) {
      device_.move(target);
      device_.read(state);
      device_.write({});
    }
    return state;
  }
  DeviceState cycles(unsigned count) {
    DeviceState state;
    for (unsigned i = 0; i < count; ++i) {
      device_.read(state);
      device_.write({});
    }
    return state;
  }

  BrowserDevice device_;
};

TEST_F(BrowserDeviceTest, GoesToItsTargetWhereNothingIsRendered) {
  const Vector3 place(0.3, -0.1, 0.2);
  const DeviceState state = led(2000, targetAt(place, 1.0));
  EXPECT_LT((state.X_DH.translation() - place).norm(), 1e-6);
  EXPECT_EQ(state.buttons, kRemoteHeld);
  RemoteView view;
  ASSERT_TRUE(device_.takeView(view));
  EXPECT_EQ(view.X_DH.translation(), state.X_DH.translation());
  EXPECT_FALSE(device_.takeView(view)) << "none is new";
}

//   S---H                     T      the proxy S is held by a contact: wherever the mouse
//   |20 mm|                          has the target T, the hand H is not farther than that
TEST_F(BrowserDeviceTest, StaysNearItsProxyWhereverTheTargetIs) {
  HandView shown;
  shown.active = true;
  shown.X_DS = Pose(Vector3(0.0, 0.0, 0.1));
  device_.show(shown);
  for (const Vector3& far : {Vector3(2.0, 0.0, 0.1), Vector3(0.0, -0.5, -3.0)}) {
    const DeviceState state = led(2000, targetAt(far, 3.0));
    const Displacement off = displacement(shown.X_DS, state.X_DH);
    EXPECT_NEAR(off.translation.norm(), BrowserDevice::kLimits.reach, 1e-6);
    EXPECT_NEAR(off.rotation.norm(), BrowserDevice::kLimits.turn, 1e-6);
    EXPECT_GT(off.translation.dot(far - shown.X_DS.translation()), 0.0) << "towards the target";
  }
}

TEST_F(BrowserDeviceTest, APageThatHangsReleasesTheDeadMansSwitchAndIsGoneLater) {
  led(50, targetAt(Vector3(1.0, 0.0, 0.0)));
  EXPECT_EQ(cycles(BrowserDevice::kLimits.silent - 2).buttons, kRemoteHeld);
  const DeviceState silent = cycles(2);
  EXPECT_EQ(silent.buttons, 0U);
  EXPECT_EQ(cycles(10).X_DH.translation(), silent.X_DH.translation()) << "it stands still";
  EXPECT_EQ(led(1, targetAt(Vector3::Zero())).buttons, kRemoteHeld) << "it is back";
  cycles(BrowserDevice::kLimits.gone - 1);
  EXPECT_FALSE(device_.isGone());
  cycles(2);
  EXPECT_TRUE(device_.isGone());
}

TEST_F(BrowserDeviceTest, AnArmingButtonThatIsDownFromTheFirstMessageIsNotPressed) {
  RemoteTarget pressed = targetAt(Vector3::Zero());
  pressed.buttons |= kRemoteArm;
  device_.move(pressed);  // before the first cycle
  EXPECT_EQ(led(10, pressed).buttons, kRemoteHeld);
  led(1, targetAt(Vector3::Zero()));
  EXPECT_EQ(led(1, pressed).buttons, pressed.buttons);
}

TEST_F(BrowserDeviceTest, AnArmingButtonThatWasHeldWhileThePageHungIsNotPressed) {
  RemoteTarget pressed = targetAt(Vector3::Zero());
  pressed.buttons |= kRemoteArm;
  led(1, targetAt(Vector3::Zero()));
  EXPECT_EQ(led(10, pressed).buttons, pressed.buttons);
  cycles(BrowserDevice::kLimits.silent);
  EXPECT_EQ(led(10, pressed).buttons, kRemoteHeld);
  led(1, targetAt(Vector3::Zero()));
  EXPECT_EQ(led(1, pressed).buttons, pressed.buttons);
}

TEST_F(BrowserDeviceTest, ACycleAllocatesNothingAndLocksNothing) {
  led(10, targetAt(Vector3(0.1, 0.0, 0.0)));
  const test::RealtimeGuard guard;
  led(1000, targetAt(Vector3(0.2, 0.0, 0.0), 0.5));
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

}  // namespace
}  // namespace tenon::devices
