#include <algorithm>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "devices/safety.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"

// The whole loop of hand, device, 1 kHz hold, encoder counts and delay against a virtual wall:
//
//    hand ~~K_arm~~> o          wall at x = 0 pushes with -K x as the encoders say
//                    |#######   the person wants to be 20 mm inside it
//                    0

namespace tenon {
namespace {

struct Trace {
  double restlessness = 0.0;  ///< [m] of travel within the last half second
  double given =
      0.0;  ///< [J] most that the device gave the hand since the touch, less the handle's own momentum
  double depth = 0.0;  ///< [m] at the end
  double felt = 0.0;   ///< [N] at the end
  bool touched = false;
};

struct Span {
  double low = 1.0, high = -1.0;
  void add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  [[nodiscard]] double width() const { return high - low; }
};

Trace pushIntoWall(const SimulatedModel& model, double K, double contraction, bool safe) {
  SimulatedDevice device(model, 5);
  EXPECT_TRUE(device.open());
  EXPECT_TRUE(device.arm());
  Safety safety(model.caps);
  device.hand().stiffen(contraction);
  device.hand().intend(Pose(Vector3(-0.01, 0.0, 0.0)));

  Trace trace;
  Span late;
  double energy = 0.0;
  Vector3 p_last = Vector3::Zero();
  for (int tick = 0; tick < 5000; ++tick) {
    // a calm approach of 0.1 m/s, then a steady push
    const double wanted = std::min(-0.01 + 1e-4 * std::max(0, tick - 800), 0.02);
    device.hand().intend(Pose(Vector3(wanted, 0.0, 0.0)));
    DeviceState state;
    device.read(state);
    const Vector3 p = device.hand().pose().translation();
    if (trace.touched) energy += device.hand().felt().force.dot(p - p_last);
    if (!trace.touched && p.x() > 0.0) {
      trace.touched = true;
      energy = -0.5 * model.mass * device.hand().velocity().linear.squaredNorm();
    }
    trace.given = std::max(trace.given, energy);
    p_last = p;

    SafetyRequest request;
    request.wanted.F_Ho_D.force.x() = -K * std::max(0.0, state.X_DH.translation().x());
    request.stiffness = K;
    device.write(safe ? safety.step(request, state, 1e-3) : request.wanted);
    if (tick >= 4500) late.add(p.x());
  }
  trace.restlessness = late.width();
  trace.depth = p_last.x();
  trace.felt = device.hand().felt().force.x();
  return trace;
}

struct Case {
  std::string name;
  SimulatedModel model;
};

void PrintTo(const Case& device, std::ostream* out) { *out << device.name; }

class Wall : public testing::TestWithParam<Case> {};

TEST_P(Wall, StandsStillAtTheStiffestTheDeviceAllows) {
  const SimulatedModel& model = GetParam().model;
  const double K = safetyLimits(model.caps).stiffness;
  for (const double contraction : {0.0, 0.5, 1.0}) {
    const Trace trace = pushIntoWall(model, K, contraction, true);
    EXPECT_LT(trace.restlessness, 1e-4 + 2.0 * model.position_resolution) << "contraction " << contraction;
    EXPECT_LT(trace.given, 1e-3) << "it gives the hand no energy that it did not take";
    EXPECT_GT(trace.depth, 0.0);
    EXPECT_LT(trace.depth, 0.012);
    EXPECT_LT(trace.felt, -1.0) << "the wall is felt";
  }
}

TEST_P(Wall, StandsStillWithoutTheHelpOfDryFriction) {
  SimulatedModel model = GetParam().model;
  model.friction = 0.0;
  const Trace trace = pushIntoWall(model, safetyLimits(model.caps).stiffness, 0.0, true);
  EXPECT_LT(trace.restlessness, 1e-4 + 2.0 * model.position_resolution);
  EXPECT_LT(trace.given, 1e-3);
}

TEST_P(Wall, AnImpossiblyStiffOneIsMadeHarmless) {
  const SimulatedModel& model = GetParam().model;
  const Trace trace = pushIntoWall(model, 40.0 * safetyLimits(model.caps).stiffness, 0.0, true);
  EXPECT_LT(trace.restlessness, 1e-4 + 2.0 * model.position_resolution);
}

INSTANTIATE_TEST_SUITE_P(Devices, Wall,
                         testing::Values(Case{"hug", hugArmModel()}, Case{"sigma7", sigma7Model()},
                                         Case{"omega3", omega3Model()}, Case{"falcon", falconModel()}),
                         [](const auto& device) { return device.param.name; });

TEST(BareWall, WithoutTheSafetyLayerTheSameWallShakesTheHand) {
  SimulatedModel bare = omega3Model();
  bare.caps.peak_force = 100.0;  // a limit or dry friction would hide how it grows
  bare.friction = 0.0;
  const Trace trace = pushIntoWall(bare, 40000.0, 0.0, false);
  EXPECT_GT(trace.restlessness, 4e-4);
  EXPECT_GT(trace.given, 0.02);
}

}  // namespace
}  // namespace tenon
