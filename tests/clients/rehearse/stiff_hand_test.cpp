#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/types/cache_folder.h"
#include "tests/clients/rehearse/path_session.h"

namespace tenon::rehearse {
namespace {

using test::follow;
using test::HandTick;
using test::HeldObject;
using test::kFalcon;
using test::kHug;
using test::kOmega;
using test::kSigma;
using test::Make;
using test::rangeOf;
using test::slopeOf;

//      z   .---.
//      |   |   |  a block of 80 x 80 x 40 mm; its origin is 20 mm above the floor when it lies there
//   ---+---+---+-----  floor
constexpr const char* kFloorScenario = R"(
title: Floor
reach: 2 m
objects:
  - name: floor
    kind: scene
    meshes: [{box: [0.4 m, 0.4 m, 0.05 m]}]
    structures: {voxel: 2 mm, spacing: 5 mm, refinement: 1}
    start: {at: [0, 0, -0.025]}
    status: fixed
  - name: block
    meshes: [{box: [80 mm, 80 mm, 40 mm]}]
    structures: {voxel: 2 mm, spacing: 2 mm, refinement: 1}
    start: {at: [0, 0, 0.2]}
  - name: pointer
    kind: pointer
    meshes: [{sphere: {diameter: 24 mm}}]
    structures: {voxel: 1 mm, points: 800, refinement: 1}
    start: {at: [0.1, 0.1, 0.3]}
hands:
  - {name: right, object: pointer}
)";

HeldObject floorScene() {
  const auto folder = std::filesystem::temp_directory_path() /
                      ("tenon_stiff_hand_" + std::to_string(static_cast<long>(getpid())));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "scenario.yaml") << kFloorScenario;
  auto loaded = session::loadScene(
      folder / "scenario.yaml",
      {.cache = defaultCache(), .read = {.taken = {{HandId{0}, ObjectId{1}}}, .needs_states = false}});
  std::filesystem::remove_all(folder);
  if (!loaded) throw std::runtime_error(loaded.error().what);
  HeldObject held{*loaded, loaded->scenario->objectNamed("block"), Pose(Vector3(0.0, 0.0, 0.02))};
  return held;
}

const HeldObject& blockOnFloor() {
  static const HeldObject held = floorScene();
  return held;
}

class StiffHand : public testing::TestWithParam<Make> {};

//   the hand sinks slowly, to 80 % of the force that the device can hold
TEST_P(StiffHand, DisplaysWhatItsDeviceAllowsAndTheProxyStaysOnTheSurface) {
  const HeldObject& held = blockOnFloor();
  const devices::SimulatedModel model = GetParam().model();
  const double K = devices::safetyLimits(model.caps).stiffness;
  const double deepest = 0.8 * model.caps.continuous_force / K;
  constexpr double kSeconds = 4.0;
  const auto samples = follow(
      GetParam(), held,
      [&](double t) { return Pose(Vector3(0.0, 0.0, -deepest * (0.2 + 0.8 * t / kSeconds))); }, kSeconds);
  std::vector<double> depth, force, server, local;
  for (const HandTick& one : samples) {
    if (one.t < 0.2) continue;
    depth.push_back(held.X_WO.translation().z() - one.X_WH.translation().z());
    force.push_back(one.motor.force.z());
    server.push_back(one.X_WO.translation().z());
    local.push_back(one.X_WO_local.translation().z());
  }
  const double slope = slopeOf(depth, force);
  EXPECT_NEAR(slope, K, 0.02 * K);
  EXPECT_LE(rangeOf(server), 1e-6);
  EXPECT_LE(rangeOf(local), 1e-6);
}

//   at rest in the contact: no ripple
TEST_P(StiffHand, RestsWithoutRipple) {
  const HeldObject& held = blockOnFloor();
  const devices::SimulatedModel model = GetParam().model();
  const double depth = 0.5 * model.caps.continuous_force / devices::safetyLimits(model.caps).stiffness;
  const auto samples = follow(
      GetParam(), held, [&](double) { return Pose(Vector3(0.0, 0.0, -depth)); }, 2.0);
  std::vector<double> force;
  for (const HandTick& one : samples)
    if (one.t > 1.0) force.push_back(one.motor.force.norm());
  EXPECT_LE(rangeOf(force), 1e-6);
  EXPECT_NEAR(force.back(), 0.5 * model.caps.continuous_force, 0.5);
  EXPECT_NEAR(samples.back().given, samples[samples.size() - 1000].given, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Devices, StiffHand, testing::Values(kHug, kSigma, kOmega, kFalcon),
                         [](const auto& make) { return std::string(make.param.name); });

/// Of the hand about the pose of contact; amplitudes in shares of what the device can hold.
struct Loop {
  const char* name;
  double frequency;                                                    // [Hz]
  double depth;                                                        // of its centre
  Vector3 cosine, sine;                                                // of its position
  Vector3 turn_cosine = Vector3::Zero(), turn_sine = Vector3::Zero();  // [rad]
};
void PrintTo(const Loop& loop, std::ostream* out) { *out << loop.name; }

class StiffLoop : public testing::TestWithParam<std::tuple<Make, Loop>> {};

TEST_P(StiffLoop, GivesTheHandNoMoreWorkThanTheDeviceDamps) {
  const auto& [make, loop] = GetParam();
  const HeldObject& held = blockOnFloor();
  const devices::SimulatedModel model = make.model();
  const double reach = 0.8 * model.caps.continuous_force / devices::safetyLimits(model.caps).stiffness;
  const double cycle = 1.0 / loop.frequency;
  const int cycles = std::max(5, static_cast<int>(loop.frequency));
  const auto at = [&](double t) {
    const double phase = 2.0 * std::numbers::pi * t * loop.frequency;
    const double c = std::cos(phase), s = std::sin(phase);
    return Pose(reach * (c * loop.cosine + s * loop.sine - loop.depth * held.normal_W),
                expRotation(c * loop.turn_cosine + s * loop.turn_sine));
  };
  const auto samples = follow(make, held, at, (cycles + 1) * cycle + 0.002);
  const auto ticks = static_cast<std::size_t>(std::lround(cycle / kTickSeconds));
  ASSERT_GT(samples.size(), ticks * static_cast<std::size_t>(cycles + 1));
  const HandTick& first = samples[ticks];
  const HandTick& last = samples[ticks * static_cast<std::size_t>(cycles + 1)];
  const double given = last.given - first.given;
  const double damped = last.damped - first.damped;
  EXPECT_LE(given - damped, 1e-4) << "given " << given << " J, damped " << damped << " J";
  double most = 0.0;
  for (const HandTick& one : samples) most = std::max(most, one.motor.force.norm());
  EXPECT_GT(most, 0.5) << "no contact";
}

const Vector3 kNone = Vector3::Zero();
INSTANTIATE_TEST_SUITE_P(
    Devices, StiffLoop,
    testing::Combine(
        testing::Values(kHug, kSigma, kOmega, kFalcon),
        testing::Values(
            Loop{"Slow", 0.5, 0.0, {0.0, 0.0, 0.8}, kNone}, Loop{"Medium", 2.0, 0.0, {0.0, 0.0, 0.8}, kNone},
            Loop{"Fast", 10.0, 0.0, {0.0, 0.0, 0.3}, kNone},
            Loop{"InContact", 10.0, 0.5, {0.0, 0.0, 0.1}, kNone},
            Loop{"Tremor", 25.0, 0.2, {0.0, 0.0, 0.03}, kNone},
            Loop{"Ellipse", 2.0, 0.0, {0.0, 0.0, 0.8}, {2.0, 0.0, 0.0}},
            Loop{"Rocking", 2.0, 0.3, kNone, kNone, {0.1, 0.0, 0.0}, {0.0, 0.1, 0.0}},
            Loop{"RockingInAndOut", 5.0, 0.1, {0.0, 0.0, 0.3}, kNone, {0.0, 0.03, 0.0}, {0.03, 0.0, 0.0}})),
    [](const auto& one) { return std::string(std::get<0>(one.param).name) + std::get<1>(one.param).name; });

//   the block lies flat while the hand turns: torque over turn, up to what the motors have
class StiffTurnOf : public testing::TestWithParam<Make> {};

TEST_P(StiffTurnOf, ItsDeviceHasTheTorqueOfItsCoupling) {
  const HeldObject& held = blockOnFloor();
  const devices::SimulatedModel model = GetParam().model();
  const devices::SafetyLimits limits = devices::safetyLimits(model.caps);
  constexpr double kSeconds = 4.0;
  const double flat = 0.02 * 0.8 * model.caps.continuous_force;  // [Nm] below which it lies flat
  const double most = std::min(1.0, 0.5 * flat / limits.rotational_stiffness);
  const double depth = 0.8 * model.caps.continuous_force / limits.stiffness;
  const auto samples = follow(
      GetParam(), held,
      [&](double t) {
        return Pose(Vector3(0.0, 0.0, -depth), expRotation({most * t / kSeconds, 0.0, 0.0}));
      },
      kSeconds);
  std::vector<double> turn, torque;
  double largest = 0.0;
  for (const HandTick& one : samples) {
    largest = std::max(largest, one.motor.torque.norm());
    if (one.t < 0.2 || one.motor.torque.norm() > 0.95 * limits.torque) continue;
    turn.push_back(-logRotation(one.X_WH.rotation()).x());
    torque.push_back(one.motor.torque.x());
  }
  const double slope = slopeOf(turn, torque);
  EXPECT_NEAR(slope, limits.rotational_stiffness, 0.02 * limits.rotational_stiffness);
  EXPECT_LE(largest, limits.torque);
}

INSTANTIATE_TEST_SUITE_P(Devices, StiffTurnOf, testing::Values(kHug, kSigma),
                         [](const auto& make) { return std::string(make.param.name); });

//   pressed with its peak force, the block tips with the hand: more torque than the motors of a sigma.7 have
TEST(StiffTurn, ShowsNoMoreTorqueThanTheMotorsHave) {
  const HeldObject& held = blockOnFloor();
  const devices::SimulatedModel model = devices::sigma7Model();
  const devices::SafetyLimits limits = devices::safetyLimits(model.caps);
  const double depth = 0.9 * model.caps.peak_force / limits.stiffness;
  const auto samples = follow(
      kSigma, held,
      [&](double t) {
        return Pose(Vector3(0.0, 0.0, -depth), expRotation({std::min(0.8, 0.4 * t), 0.0, 0.0}));
      },
      3.0);
  double largest = 0.0;
  for (const HandTick& one : samples) largest = std::max(largest, one.motor.torque.norm());
  EXPECT_NEAR(largest, limits.torque, 1e-9);
}

}  // namespace
}  // namespace tenon::rehearse
