#include "clients/haptic/device_handover.h"

#include <functional>
#include <utility>

#include <gtest/gtest.h>

#include "devices/simulated/hug.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::haptic {
namespace {

/// Something happens while it is armed or reset.
class SlowDevice : public devices::SimulatedDevice {
 public:
  SlowDevice() : SimulatedDevice(devices::hugArmModel(), 1) { EXPECT_TRUE(open()); }
  [[nodiscard]] Result<void> arm() override {
    ++armed;
    if (during_arm) std::exchange(during_arm, {})();
    return SimulatedDevice::arm();
  }
  [[nodiscard]] Result<void> resetFault() override {
    ++reset;
    return SimulatedDevice::resetFault();
  }
  int armed = 0, reset = 0;
  std::function<void()> during_arm;
};

TEST(DeviceHandover, APressAfterAWithdrawnRequestIsNotLost) {
  DeviceHandover handover;
  SlowDevice device;
  handover.ask();
  handover.withdraw();
  ASSERT_TRUE(handover.serve(device));
  EXPECT_EQ(device.armed, 0);
  // another arm is still being armed meanwhile
  handover.ask();
  handover.handBack();
  ASSERT_TRUE(handover.pending());
  ASSERT_TRUE(handover.serve(device));
  EXPECT_EQ(device.armed, 1);
  handover.handBack();
  EXPECT_FALSE(handover.pending());
}

TEST(DeviceHandover, AHandThatBeginsArmsItsDeviceWithoutAResetWhichIsThePersonsAlone) {
  DeviceHandover handover;
  SlowDevice device;
  handover.askWithoutReset();
  ASSERT_TRUE(handover.serve(device));
  EXPECT_EQ(device.armed, 1);
  EXPECT_EQ(device.reset, 0);
  handover.handBack();
  EXPECT_FALSE(handover.pending());

  // a press while it is armed is for a reset
  handover.askWithoutReset();
  device.during_arm = [&] { handover.ask(); };
  ASSERT_TRUE(handover.serve(device));
  handover.handBack();
  ASSERT_TRUE(handover.pending());
  ASSERT_TRUE(handover.serve(device));
  EXPECT_EQ(device.reset, 1);
  handover.handBack();
  EXPECT_FALSE(handover.pending());
}

TEST(DeviceHandover, AStopWhileTheDeviceIsArmedHandsItBack) {
  DeviceHandover handover;
  SlowDevice device;
  device.during_arm = [&] { handover.withdraw(); };
  handover.ask();
  ASSERT_TRUE(handover.serve(device));
  handover.handBack();
  EXPECT_FALSE(handover.pending()) << "the stop disarms it";
}

}  // namespace
}  // namespace tenon::haptic
