#include "devices/simulated/simulated_device.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"
#include "idl/types/hash.h"
#include "idl/types/messages/hands.h"

namespace tenon::devices {
namespace {

/// A device without friction, damping or quantisation: the closed-form solution of an oscillator applies.
SimulatedModel frictionlessMass() {
  SimulatedModel model;
  model.caps.model = "frictionless mass";
  model.caps.dof_mask = kAllDofs;
  model.caps.workspace_radius = 1.0;
  model.caps.rotation_range = 3.0;
  model.caps.peak_force = 100.0;
  model.caps.torque = 10.0;
  model.mass = 0.45;
  return model;
}

HumanArmModel springOf(double mass, double stiffness, double damping) {
  HumanArmModel arm;
  arm.mass = mass;
  arm.stiffness = stiffness;
  arm.damping = damping;
  return arm;
}

DeviceState cycle(SimulatedDevice& device, const Wrench& F_Ho_D = {}) {
  DeviceState state;
  device.read(state);
  device.write({F_Ho_D, false, {}});
  return state;
}

Wrench along(double x) { return {Vector3(x, 0.0, 0.0), Vector3::Zero()}; }

TEST(SimulatedDevice, MovesLikeADampedOscillatorInTheHumanArm) {
  SimulatedDevice device(frictionlessMass());
  ASSERT_TRUE(device.open());
  constexpr double kStiffness = 135.0;
  constexpr double kDamping = 6.5;
  device.humanArm() = HumanArm(springOf(0.55, kStiffness, kDamping));  // 1 kg together with the device
  device.humanArm().setIntent(Pose(Vector3(0.02, 0.0, 0.0)));

  const double decay = kDamping / 2.0;
  const double omega = std::sqrt(kStiffness - decay * decay);
  for (int tick = 1; tick <= 1500; ++tick) {
    cycle(device);
    const double t = tick * 1e-3;
    const double analytic =
        0.02 * (1.0 - std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t)));
    EXPECT_NEAR(device.humanArm().pose().translation().x(), analytic, 0.02 * 0.02) << "at " << t << " s";
  }
}

TEST(SimulatedDevice, TheHandReceivesTheCommandedWrenchAtRest) {
  SimulatedDevice device(frictionlessMass());
  ASSERT_TRUE(device.open());
  ASSERT_TRUE(device.arm());
  Wrench commanded{Vector3(3.0, -1.0, 0.5), Vector3(0.0, 0.1, 0.0)};
  for (int tick = 0; tick < 4000; ++tick) cycle(device, commanded);
  EXPECT_LT((device.humanArm().handleWrench().force - commanded.force).norm(), 1e-3);
  EXPECT_LT((device.humanArm().handleWrench().torque - commanded.torque).norm(), 1e-3);
  // deflection of the arm: F / K
  EXPECT_LT((device.humanArm().pose().translation() - commanded.force / 135.0).norm(), 1e-4);
}

TEST(SimulatedDevice, ABracedArmDeflectsLess) {
  const auto deflection = [](double contraction) {
    SimulatedDevice device(frictionlessMass());
    EXPECT_TRUE(device.open());
    EXPECT_TRUE(device.arm());
    device.humanArm().setContraction(contraction);
    for (int tick = 0; tick < 4000; ++tick) cycle(device, along(5.0));
    return device.humanArm().pose().translation().x();
  };
  EXPECT_NEAR(deflection(0.0), 5.0 / 135.0, 1e-4);
  EXPECT_NEAR(deflection(1.0), 5.0 / 500.0, 1e-4);
}

TEST(SimulatedDevice, DryFrictionSticksAndSlipsWithoutChatter) {
  SimulatedModel model = frictionlessMass();
  model.friction = 1.0;
  SimulatedDevice device(model);
  ASSERT_TRUE(device.open());
  // 135 N/m over 4 mm: 0.5 N, below static friction: sticks exactly
  device.humanArm().setIntent(Pose(Vector3(0.004, 0.0, 0.0)));
  for (int tick = 0; tick < 500; ++tick) cycle(device);
  EXPECT_EQ(device.humanArm().pose().translation(), Vector3(Vector3::Zero()));
  // 30 mm: 4 N, above friction: slips and comes to rest
  device.humanArm().setIntent(Pose(Vector3(0.030, 0.0, 0.0)));
  for (int tick = 0; tick < 3000; ++tick) cycle(device);
  const Vector3 rest = device.humanArm().pose().translation();
  EXPECT_GT(rest.x(), 0.015);
  for (int tick = 0; tick < 500; ++tick) cycle(device);
  EXPECT_EQ(device.humanArm().pose().translation(), rest);
}

TEST(SimulatedDevice, QuantisesPositionToEncoderCounts) {
  SimulatedDevice device(falconModel());
  ASSERT_TRUE(device.open());
  device.humanArm().setIntent(Pose(Vector3(0.02, -0.01, 0.005)));
  for (int tick = 0; tick < 300; ++tick) {
    const Vector3 counts = cycle(device).X_DH.translation() / 4e-5;
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(counts[axis], std::round(counts[axis]), 1e-6);
  }
}

TEST(SimulatedDevice, MeasuresTheMeanVelocityOfItsWindow) {
  SimulatedDevice device(sigma7Model());
  ASSERT_TRUE(device.open());
  Pose past[21];
  double fastest = 0.0;
  for (int tick = 0; tick < 200; ++tick) {
    device.humanArm().setIntent(Pose(Vector3(2e-4 * tick, 0.0, 0.0)),
                                {Vector3(0.2, 0.0, 0.0), Vector3::Zero()});
    const DeviceState state = cycle(device);
    std::move_backward(past, past + 20, past + 21);
    past[0] = state.X_DH;
    if (tick < 20) continue;
    EXPECT_NEAR(state.V_DH.linear.x(), (past[0].translation() - past[20].translation()).x() / 0.020, 1e-12);
    fastest = std::max(fastest, state.V_DH.linear.x());
  }
  EXPECT_GT(fastest, 0.1) << "the hand moves it";
}

TEST(SimulatedDevice, AForceActsAfterTheDelayOfTheModel) {
  for (const unsigned delay : {0U, 1U, 3U}) {
    SimulatedModel model = frictionlessMass();
    model.delay = delay;
    SimulatedDevice device(model);
    ASSERT_TRUE(device.open());
    ASSERT_TRUE(device.arm());
    cycle(device, along(1.0));
    unsigned reads = 0;
    while (device.motorWrench().force.x() == 0.0 && reads < 10) {
      cycle(device, along(1.0));
      ++reads;
    }
    EXPECT_EQ(reads, delay + 1);
  }
}

// With the public Falcon driver a command of 60 N wraps around to the opposite sign.
TEST(SimulatedDevice, AnExcessiveFalconCommandSaturatesAndDoesNotWrapAround) {
  SimulatedDevice falcon(falconModel());
  ASSERT_TRUE(falcon.open());
  ASSERT_TRUE(falcon.arm());
  for (int tick = 0; tick < 5; ++tick) cycle(falcon, {Vector3(60.0, -60.0, 1.0), Vector3::Zero()});
  const Vector3& motor = falcon.motorWrench().force;
  EXPECT_DOUBLE_EQ(motor.x(), 8.0);
  EXPECT_DOUBLE_EQ(motor.y(), -8.0);
  EXPECT_NEAR(motor.z(), 1.0, falcon.caps().force_quantum / 2.0);
}

TEST(SimulatedDevice, AThreeAxisDeviceDoesNotRotate) {
  SimulatedDevice omega(omega3Model());
  ASSERT_TRUE(omega.open());
  ASSERT_TRUE(omega.arm());
  omega.humanArm().setIntent(Pose(Vector3::Zero(), expRotation({0.0, 0.5, 0.0})));
  for (int tick = 0; tick < 500; ++tick) {
    const DeviceState state = cycle(omega, {Vector3::Zero(), Vector3(1.0, 1.0, 1.0)});
    EXPECT_EQ(state.X_DH.rotation().coeffs(), Quaternion::Identity().coeffs());
  }
}

TEST(SimulatedDevice, FollowsTheRotationOfTheWrist) {
  SimulatedDevice sigma(sigma7Model());
  ASSERT_TRUE(sigma.open());
  const Vector3 turned(0.0, 0.6, 0.3);
  sigma.humanArm().setIntent(Pose(Vector3::Zero(), expRotation(turned)));
  DeviceState state;
  for (int tick = 0; tick < 3000; ++tick) state = cycle(sigma);
  EXPECT_LT((logRotation(state.X_DH.rotation()) - turned).norm(), 0.02) << "dry friction leaves an error";
}

TEST(SimulatedDevice, EndStopsHoldTheHandBack) {
  SimulatedDevice sigma(sigma7Model());
  ASSERT_TRUE(sigma.open());
  sigma.humanArm().setIntent(Pose(Vector3(0.0, 0.5, 0.0), expRotation({2.5, 0.0, 0.0})));
  for (int tick = 0; tick < 3000; ++tick) cycle(sigma);
  const Pose& X_DH = sigma.humanArm().pose();
  EXPECT_GT(X_DH.translation().y(), 0.060);
  EXPECT_LT(X_DH.translation().y(), 0.060 + 0.025);
  EXPECT_LT(logRotation(X_DH.rotation()).norm(), 1.2 + 0.15);
}

TEST(SimulatedDevice, RepeatsBitByBitForOneSeedAndDiffersForAnother) {
  const auto session = [](std::uint64_t seed) {
    SimulatedDevice arm(hugArmModel(), seed);
    EXPECT_TRUE(arm.open());
    EXPECT_TRUE(arm.arm());
    StateHash hash;
    for (int tick = 0; tick < 1000; ++tick) {
      arm.humanArm().setIntent(Pose(Vector3(1e-4 * tick, 0.0, 0.0), expRotation({0.0, 1e-3 * tick, 0.0})));
      const DeviceState state = cycle(arm, along(-2.0));
      hash.add(state.X_DH);
      hash.add(state.F_Ho_D_measured.force);
    }
    return hash.value();
  };
  EXPECT_EQ(session(7), session(7));
  EXPECT_NE(session(7), session(8));
}

TEST(SimulatedDevice, ReportsNoNewReadingsAfterALossOfCommunication) {
  SimulatedDevice sigma(sigma7Model());
  ASSERT_TRUE(sigma.open());
  ASSERT_TRUE(sigma.arm());
  const std::uint64_t seq = cycle(sigma).seq;
  sigma.unplug();
  const DeviceState state = cycle(sigma);
  EXPECT_EQ(state.seq, seq);
  EXPECT_FALSE(state.forces_on);
  EXPECT_EQ(state.fault, DeviceFault::kCommunication);
  EXPECT_FALSE(sigma.arm());
  EXPECT_TRUE(sigma.open());
  EXPECT_EQ(cycle(sigma).fault, DeviceFault::kNone);
}

TEST(SimulatedDevice, ReportsPressedButtons) {
  SimulatedDevice sigma(sigma7Model());
  ASSERT_TRUE(sigma.open());
  sigma.humanArm().setButtons(1);
  EXPECT_EQ(cycle(sigma).buttons, 1U);
}

}  // namespace
}  // namespace tenon::devices
