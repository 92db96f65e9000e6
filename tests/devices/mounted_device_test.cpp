#include "devices/mounted_device.h"

#include <gtest/gtest.h>

#include "devices/catalog.h"
#include "devices/simulated/body_tracker.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::devices {
namespace {

//   a quarter turn about z: what the device calls x is away from the user, D's y
TEST(MountedDevice, TurnsReadingsIntoTheFrameOfStationsAndForcesBack) {
  DeviceConfiguration configuration;
  configuration.q_DM = expRotation(Vector3(0.0, 0.0, 0.5 * 3.14159265358979));
  const auto device = std::move(*openDevice("sigma7-sim", configuration));
  auto& bare = dynamic_cast<SimulatedDevice&>(device->inner());
  ASSERT_TRUE(device->arm());
  HumanArm* const arm = simulatedHumanArm(*device);
  ASSERT_NE(arm, nullptr);
  arm->setIntent(Pose(Vector3(0.02, 0.0, 0.0), expRotation(Vector3(0.2, 0.0, 0.0))));
  arm->setContraction(1.0);
  DeviceState state;
  for (int tick = 0; tick < 1000; ++tick) {
    device->read(state);
    device->write({{Vector3(0.0, 1.0, 0.0), Vector3::Zero()}, false, {}});
  }
  EXPECT_NEAR(state.X_DH.translation().x(), 0.0, 1e-3);
  EXPECT_GT(state.X_DH.translation().y(), 0.015);
  const Vector3 turned = logRotation(state.X_DH.rotation());
  EXPECT_NEAR(turned.x(), 0.0, 0.02);
  EXPECT_GT(turned.y(), 0.1);
  EXPECT_NEAR(bare.motorWrench().force.x(), 1.0, 1e-3);
  EXPECT_NEAR(bare.motorWrench().force.y(), 0.0, 1e-3);
}

TEST(MountedDevice, KeepsBothArmsOfABimanualDevice) {
  DeviceConfiguration configuration;
  configuration.q_DM = expRotation(Vector3(0.0, 0.0, 1.0));
  const auto pair = std::move(*openBimanualDevice("hug-sim", configuration));
  EXPECT_NE(simulatedHumanArm(pair->right()), nullptr);
  EXPECT_NE(simulatedHumanArm(pair->right()), simulatedHumanArm(pair->left()));
}

TEST(BodyTracker, SeesABodyWhereItIsUntilItsMarkersAreCovered) {
  const auto tracker = std::move(*openTracker(kBodyTracker));
  BodyTracker* const simulated = simulatedBodyTracker(*tracker);
  ASSERT_NE(simulated, nullptr);
  TrackerReading reading;
  tracker->read(TrackedBody::kPart, reading);
  EXPECT_FALSE(reading.visible) << "nobody has put it anywhere";
  const Pose X_TB(Vector3(0.1, 0.2, 0.3));
  simulated->place(TrackedBody::kPart, X_TB);
  tracker->read(TrackedBody::kPart, reading);
  EXPECT_TRUE(reading.visible);
  EXPECT_EQ(reading.X_TB, X_TB);
  simulated->hide(TrackedBody::kPart);
  tracker->read(TrackedBody::kPart, reading);
  EXPECT_FALSE(reading.visible);
  EXPECT_EQ(reading.X_TB, X_TB) << "where it was last seen";
  EXPECT_FALSE(openTracker("nosuch"));
}

}  // namespace
}  // namespace tenon::devices
