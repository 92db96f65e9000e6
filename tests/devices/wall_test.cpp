#include <algorithm>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "devices/safety.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"

// Closed loop of arm, device, 1 kHz hold, encoder quantisation and delay against a virtual wall:
//
//    hand ~~K_arm~~> o          wall at x = 0: force -K x of the measured x
//                    |#######   the intended pose is 20 mm inside it
//                    0

namespace tenon::devices {
namespace {

struct WallContact {
  double oscillation = 0.0;  ///< [m] peak to peak within the last half second
  /// [J] largest energy delivered to the hand since the first contact, less the kinetic energy of the handle
  double delivered = 0.0;
  double depth = 0.0;  ///< [m] at the end
  double force = 0.0;  ///< [N] on the hand, at the end
  bool touched = false;
};

struct MinMax {
  double low = 1.0, high = -1.0;
  void add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  [[nodiscard]] double width() const { return high - low; }
};

WallContact pushIntoWall(const SimulatedModel& model, double K, double contraction, bool with_safety_layer) {
  SimulatedDevice device(model, 5);
  EXPECT_TRUE(device.open());
  EXPECT_TRUE(device.arm());
  Safety safety(model.caps);
  device.humanArm().setContraction(contraction);
  device.humanArm().setIntent(Pose(Vector3(-0.01, 0.0, 0.0)));

  WallContact contact;
  MinMax late;
  double energy = 0.0;
  Vector3 p_last = Vector3::Zero();
  for (int tick = 0; tick < 5500; ++tick) {
    // approach at 0.1 m/s once the soft start is over, then a constant push
    const double intended = std::min(-0.01 + 1e-4 * std::max(0, tick - 1300), 0.02);
    device.humanArm().setIntent(Pose(Vector3(intended, 0.0, 0.0)));
    DeviceState state;
    device.read(state);
    const Vector3 p = device.humanArm().pose().translation();
    if (contact.touched) energy += device.humanArm().handleWrench().force.dot(p - p_last);
    if (!contact.touched && p.x() > 0.0) {
      contact.touched = true;
      energy = -0.5 * model.mass * device.humanArm().velocity().linear.squaredNorm();
    }
    contact.delivered = std::max(contact.delivered, energy);
    p_last = p;

    SafetyRequest request;
    request.requested.F_Ho_D.force.x() = -K * std::max(0.0, state.X_DH.translation().x());
    request.stiffness = K;
    device.write(with_safety_layer ? safety.step(request, state, 1e-3) : request.requested);
    if (tick >= 5000) late.add(p.x());
  }
  contact.oscillation = late.width();
  contact.depth = p_last.x();
  contact.force = device.humanArm().handleWrench().force.x();
  return contact;
}

struct WallDevice {
  std::string name;
  SimulatedModel model;
};

void PrintTo(const WallDevice& device, std::ostream* out) { *out << device.name; }

class VirtualWall : public testing::TestWithParam<WallDevice> {};

TEST_P(VirtualWall, IsStableAtTheLargestPassiveStiffness) {
  const SimulatedModel& model = GetParam().model;
  const double K = safetyLimits(model.caps).stiffness;
  for (const double contraction : {0.0, 0.5, 1.0}) {
    const WallContact contact = pushIntoWall(model, K, contraction, true);
    EXPECT_LT(contact.oscillation, 1e-4 + 2.0 * model.position_resolution) << "contraction " << contraction;
    EXPECT_LT(contact.delivered, 1e-3) << "no net energy is delivered to the hand";
    EXPECT_GT(contact.depth, 0.0);
    EXPECT_LT(contact.depth, 0.012);
    EXPECT_LT(contact.force, -1.0) << "the wall pushes back";
  }
}

TEST_P(VirtualWall, IsStableWithoutDryFriction) {
  SimulatedModel model = GetParam().model;
  model.friction = 0.0;
  const WallContact contact = pushIntoWall(model, safetyLimits(model.caps).stiffness, 0.0, true);
  EXPECT_LT(contact.oscillation, 1e-4 + 2.0 * model.position_resolution);
  EXPECT_LT(contact.delivered, 1e-3);
}

TEST_P(VirtualWall, AnExcessiveStiffnessIsLimitedToAStableOne) {
  const SimulatedModel& model = GetParam().model;
  const WallContact contact = pushIntoWall(model, 40.0 * safetyLimits(model.caps).stiffness, 0.0, true);
  EXPECT_LT(contact.oscillation, 1e-4 + 2.0 * model.position_resolution);
}

INSTANTIATE_TEST_SUITE_P(Devices, VirtualWall,
                         testing::Values(WallDevice{"hug", hugArmModel()},
                                         WallDevice{"sigma7", sigma7Model()},
                                         WallDevice{"omega3", omega3Model()},
                                         WallDevice{"falcon", falconModel()}),
                         [](const auto& device) { return device.param.name; });

TEST(UnlimitedWall, OscillatesWithoutTheSafetyLayer) {
  SimulatedModel omega = omega3Model();
  omega.caps.peak_force = 100.0;  // a force limit or dry friction would bound the oscillation
  omega.friction = 0.0;
  const WallContact contact = pushIntoWall(omega, 40000.0, 0.0, false);
  EXPECT_GT(contact.oscillation, 4e-4);
  EXPECT_GT(contact.delivered, 0.02);
}

}  // namespace
}  // namespace tenon::devices
