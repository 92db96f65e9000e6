#include "clients/haptic/haptic_hand.h"

#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "devices/simulated/sigma7.h"
#include "tests/clients/haptic/hand_above_floor.h"
#include "tests/support/realtime_guard.h"

namespace tenon::haptic {
namespace {

using test::HandAboveFloor;

class HapticHandWithDevice : public testing::TestWithParam<std::string> {};

TEST_P(HapticHandWithDevice, RestsOnAFloorWithStiffnessTimesDepth) {
  HandAboveFloor setup(GetParam());
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, -0.01));
  const double depth = 0.012 - setup.hand.pose().translation().z();
  const double force = setup.hand.state().F_Ho_W.force.z();
  EXPECT_GT(force, 1.0);
  EXPECT_NEAR(force, 1000.0 * depth, 0.02 * force + 0.05);
  EXPECT_NEAR(setup.hand.state().X_WO_local.translation().z(), 0.012, 1e-6);
  EXPECT_TRUE(setup.hand.inContact());
}

TEST_P(HapticHandWithDevice, SendsItsNewestReading) {
  HandAboveFloor setup(GetParam());
  for (int i = 0; i < 10; ++i) setup.step(Vector3(0.0, 0.0, 0.03));
  const DeviceInput& input = setup.hand.input();
  EXPECT_TRUE(input.active);
  EXPECT_EQ(input.sample.seq, 10U);
  EXPECT_EQ(setup.hand.state().p_WC, setup.hand.workspace().centre());
}

/// Keeps what its owner would see.
class ShowingDevice final : public devices::SimulatedDevice {
 public:
  ShowingDevice() : SimulatedDevice(devices::sigma7Model()) { EXPECT_TRUE(open()); }
  void show(const devices::HandView& view) noexcept override { shown = view; }
  devices::HandView shown;
};

//   ( )   proxy and object stay on the floor while the hand is in it, in the device's frame
//   ~o~
TEST(HapticHandView, ShowsItsDeviceProxyObjectAndContact) {
  auto owned = std::make_unique<ShowingDevice>();
  const ShowingDevice& device = *owned;
  HandAboveFloor setup(std::move(owned));
  for (int i = 0; i < 100; ++i) setup.step(Vector3(0.0, 0.0, 0.03));
  EXPECT_FALSE(device.shown.in_contact);
  for (int i = 0; i < 3000; ++i) setup.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_TRUE(device.shown.active);
  EXPECT_TRUE(device.shown.in_contact);
  EXPECT_EQ(device.shown.object, test::kBall);
  EXPECT_EQ(device.shown.p_WC, setup.hand.workspace().centre());
  EXPECT_NEAR((device.shown.p_WC + device.shown.X_DO.translation()).z(), 0.012, 1e-6);
  EXPECT_NEAR((device.shown.p_WC + device.shown.X_DS.translation()).z(), 0.012, 1e-6);
  EXPECT_LT(setup.hand.pose().translation().z(), 0.0115) << "the hand is deeper";
}

TEST_P(HapticHandWithDevice, TurnsItsForcesOffDuringAnEmergencyStop) {
  HandAboveFloor setup(GetParam());
  for (int i = 0; i < 1500; ++i) setup.step(Vector3(0.0, 0.0, 0.0));
  ASSERT_GT(setup.hand.state().F_Ho_W.force.norm(), 0.5);
  setup.hand.permitForces(false);
  setup.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_EQ(setup.hand.state().F_Ho_W.force.norm(), 0.0);
  EXPECT_FALSE(setup.hand.input().active);
  setup.hand.permitForces(true);
  ASSERT_TRUE(setup.hand.armDevice());
  setup.hand.handBack();
  for (int i = 0; i < 1500; ++i) setup.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_TRUE(setup.hand.input().active);
  EXPECT_GT(setup.hand.state().F_Ho_W.force.norm(), 0.5);
}

TEST_P(HapticHandWithDevice, AllocatesNothingAndLocksNothing) {
  HandAboveFloor setup(GetParam());
  for (int i = 0; i < 100; ++i) setup.step(Vector3(0.0, 0.0, 0.0));
  const test::RealtimeGuard guard;
  for (int i = 0; i < 200; ++i) setup.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

INSTANTIATE_TEST_SUITE_P(Devices, HapticHandWithDevice,
                         testing::Values("sigma7-sim", "omega3-sim", "falcon-sim"), [](const auto& device) {
                           const std::string& name = device.param;
                           return name.substr(0, name.find('-'));
                         });

}  // namespace
}  // namespace tenon::haptic
