#include "clients/haptic/haptic_hand.h"

#include <gtest/gtest.h>

#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"
#include "tests/clients/haptic/plane_server.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

using test::PlaneServer;

/// A simulated device in a simulated hand before a floor at z = 0, ball in the hand.
struct Desk {
  explicit Desk(const char* name) : device(std::move(*openDevice(name))), hand(*device) {
    world.begin(server.objects(), 0, 0);
    EXPECT_TRUE(hand.begin(test::kHand, ClientId{1}, Vector3(0.0, 0.0, 0.03)));
  }
  /// A millisecond of a session with the person wanting her hand at p_WI.
  void step(const Vector3& p_WI) {
    ++tick;
    handOf(*device)->intend(hand.workspace().toDevice(Pose(p_WI)));
    world.receive(server.frame(tick));
    hand.receive(server.manifold(tick, hand.pose()));
    hand.step(static_cast<std::uint32_t>(tick), world, kTickSeconds);
  }

  PlaneServer server{1000.0};
  std::unique_ptr<HapticDevice> device;
  HapticHand hand;
  WorldView world;
  Tick tick = 0;
};

class HapticHandOfEach : public testing::TestWithParam<const char*> {};

TEST_P(HapticHandOfEach, RestsOnAFloorWithTheForceOfTheWallsStiffness) {
  Desk desk(GetParam());
  for (int i = 0; i < 3000; ++i) desk.step(Vector3(0.0, 0.0, -0.01));
  const double depth = 0.012 - desk.hand.pose().translation().z();
  const double force = desk.hand.state().F_Ho_W.force.z();
  EXPECT_GT(force, 1.0);
  EXPECT_NEAR(force, 1000.0 * depth, 0.02 * force + 0.05);
  EXPECT_NEAR(desk.hand.state().X_WO_local.translation().z(), 0.012, 1e-6);
  EXPECT_TRUE(desk.hand.inContact());
}

TEST_P(HapticHandOfEach, TellsTheServerTheNewestReadingFirstAndRepeatsThree) {
  Desk desk(GetParam());
  for (int i = 0; i < 10; ++i) desk.step(Vector3(0.0, 0.0, 0.03));
  const DeviceInput& input = desk.hand.input();
  EXPECT_TRUE(input.active);
  EXPECT_EQ(input.heard_tick, 10U);
  for (std::uint32_t i = 0; i < 4; ++i) EXPECT_EQ(input.samples[i].seq, 10 - i);
  EXPECT_EQ(input.p_WC, desk.hand.workspace().centre());
}

TEST_P(HapticHandOfEach, TakesItsForcesOffAtAnEmergencyStop) {
  Desk desk(GetParam());
  for (int i = 0; i < 1500; ++i) desk.step(Vector3(0.0, 0.0, 0.0));
  ASSERT_GT(desk.hand.state().F_Ho_W.force.norm(), 0.5);
  desk.hand.stop(true);
  desk.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_EQ(desk.hand.state().F_Ho_W.force.norm(), 0.0);
  EXPECT_FALSE(desk.hand.input().active);
  desk.hand.stop(false);
  for (int i = 0; i < 1500; ++i) desk.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_TRUE(desk.hand.input().active);
  EXPECT_GT(desk.hand.state().F_Ho_W.force.norm(), 0.5);
}

TEST_P(HapticHandOfEach, AllocatesNothingAndLocksNothing) {
  Desk desk(GetParam());
  for (int i = 0; i < 100; ++i) desk.step(Vector3(0.0, 0.0, 0.0));
  const test::RealtimeGuard guard;
  for (int i = 0; i < 200; ++i) desk.step(Vector3(0.0, 0.0, 0.0));
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

INSTANTIATE_TEST_SUITE_P(Devices, HapticHandOfEach, testing::Values("sigma7-sim", "omega3-sim", "falcon-sim"),
                         [](const auto& each) {
                           const std::string name = each.param;
                           return name.substr(0, name.find('-'));
                         });

}  // namespace
}  // namespace tenon
