#pragma once

#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "clients/haptic/haptic_hand.h"
#include "devices/catalog.h"
#include "devices/simulated/simulated_device.h"
#include "tests/clients/haptic/plane_server.h"

namespace tenon::test {

/// A simulated device held by a simulated arm; it moves a ball above a floor at z = 0. The server answers an
/// input one tick later.
struct HandAboveFloor {
  explicit HandAboveFloor(const std::string& name) : HandAboveFloor(std::move(*devices::openDevice(name))) {}
  /// `height` [m] of the hand, at the centre of its device; `stiffness` [N/m] of the coupling.
  explicit HandAboveFloor(std::unique_ptr<devices::HapticDevice> held, double height = 0.03,
                          double stiffness = 1000.0)
      : server(stiffness), device(std::move(held)), hand(*device) {
    world.begin(server.objects(), 0, 0);
    hand.begin(kHand, ClientId{1}, Vector3(0.0, 0.0, height), true);
    EXPECT_TRUE(hand.armDevice());
    hand.handBack();
  }
  [[nodiscard]] devices::HumanArm& arm() const { return *devices::simulatedHumanArm(*device); }
  [[nodiscard]] double force() const { return hand.state().F_Ho_W.force.norm(); }

  /// The person wants the hand at p_WI.
  void intend(const Vector3& p_WI) { arm().setIntent(hand.workspace().toDevice(Pose(p_WI))); }
  /// The server's answer to the newest input arrives.
  void answer() {
    world.receive(server.frame(tick));
    hand.receive(server.manifold(tick, hand.pose()));
  }
  /// A cycle of the station alone, of `dt` [s].
  void cycle(double dt = kTickSeconds) {
    ++tick;
    hand.step(static_cast<std::uint32_t>(tick), world, dt);
  }
  /// One millisecond of a session with the intended hand position p_WI.
  void step(const Vector3& p_WI) {
    intend(p_WI);
    ++tick;
    answer();
    hand.step(static_cast<std::uint32_t>(tick), world, kTickSeconds);
  }

  PlaneServer server;
  std::unique_ptr<devices::HapticDevice> device;
  haptic::HapticHand hand;
  haptic::WorldView world;
  Tick tick = 0;
};

}  // namespace tenon::test
