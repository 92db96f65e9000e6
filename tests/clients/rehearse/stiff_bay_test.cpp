#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/cache_folder.h"
#include "tests/clients/rehearse/path_session.h"
#include "tests/support/source_folder.h"

namespace tenon::rehearse {
namespace {

using test::follow;
using test::HandTick;
using test::HeldObject;
using test::kFalcon;
using test::kHug;
using test::kSigma;
using test::Make;
using test::rangeOf;
using test::slopeOf;

// Contacts of the engine bay: parts that its hands hold, pressed at things of it. Where a part comes to rest
// and along which normal, the session itself says.

struct BayContact {
  const char* part;
  const char* name;
  Vector3 p_WP;         ///< [m] a point of what it is pressed at
  Vector3 direction_W;  ///< of the push
};
void PrintTo(const BayContact& contact, std::ostream* out) { *out << contact.part << " at " << contact.name; }

/// The part that `contact` names where it rests, 1 N before it. The hand's frame is at the part's.
HeldObject restingInBay(const BayContact& contact) {
  const auto folder = test::sourceFolder() / "scenarios" / "engine_bay";
  const auto scenario = game_control::readScenario(folder / "scenario.yaml");
  if (!scenario) throw std::runtime_error(scenario.error().what);
  const ObjectId part = scenario->objectNamed(contact.part);
  auto loaded = session::loadScene(folder, {.cache = defaultCache(),
                                            .detail = 0.12,
                                            .read = {.taken = {{HandId{0}, part}}, .needs_states = false}});
  if (!loaded) throw std::runtime_error(loaded.error().what);
  const structures::HapticStructures& structures = *loaded->scene->objects[part.value].structures;
  const Vector3 middle = structures.info.box_M.center();
  double reach = 0.0;
  for (const structures::ShellPoint& point : structures.shell.points())
    reach = std::max(reach, (point.p_MP.cast<double>() - middle).dot(contact.direction_W));
  const auto before = [&](double gap) {
    return Pose(contact.p_WP - (gap + reach) * contact.direction_W - middle);
  };
  HeldObject held{*loaded, part, before(0.1), -contact.direction_W};
  constexpr double kSpeed = 0.2;  // [m/s]
  // a first session, to find the place
  const auto pushed = follow(
      kHug, held, [&](double t) { return Pose(Vector3(std::min(kSpeed * t, 0.15) * contact.direction_W)); },
      1.5);
  for (const HandTick& one : pushed) {
    if (one.motor.force.norm() < 1.0) continue;
    held.X_WO = one.X_WO;
    held.normal_W = one.motor.force.normalized();
    return held;
  }
  ADD_FAILURE() << "no contact of " << contact.part << " at " << contact.name;
  return held;
}

class StiffHandInBayNightly : public testing::TestWithParam<std::tuple<Make, BayContact>> {};

TEST_P(StiffHandInBayNightly, TheProxyRestsTheForceIsThatOfTheDeviceAndALoopGivesNoWork) {
  const auto& [make, contact] = GetParam();
  const HeldObject held = restingInBay(contact);
  const devices::SimulatedModel model = make.model();
  const double K = devices::safetyLimits(model.caps).stiffness;
  const double deepest = 0.8 * model.caps.continuous_force / K;
  const Vector3 n = held.normal_W;

  constexpr double kSeconds = 4.0;
  const auto sinking = follow(
      make, held, [&](double t) { return Pose(-deepest * (0.2 + 0.8 * std::min(1.0, t / kSeconds)) * n); },
      kSeconds + 1.0);
  std::vector<double> stretch, force, along, resting, resting_local;
  for (const HandTick& one : sinking) {
    if (one.t < 0.2) continue;
    // of the coupling: what the device displays over how far the hand is from the proxy
    stretch.push_back((one.X_WO.translation() - one.X_WH.translation()).norm());
    force.push_back(one.motor.force.norm());
    along.push_back(one.X_WO.translation().dot(n));
    if (one.t < kSeconds + 0.5) continue;
    resting.push_back(one.X_WO.translation().dot(n));
    resting_local.push_back(one.X_WO_local.translation().dot(n));
  }
  const double slope = slopeOf(stretch, force);
  EXPECT_NEAR(slope, K, 0.02 * K);
  EXPECT_LE(rangeOf(resting), 1e-6);
  EXPECT_LE(rangeOf(resting_local), 1e-6);

  double most = -1.0;
  for (const double frequency : {2.0, 10.0}) {
    const double cycle = 1.0 / frequency;
    const auto at = [&](double t) {
      return Pose(deepest * (frequency > 5.0 ? 0.3 : 0.8) * std::cos(2.0 * std::numbers::pi * t * frequency) *
                  n);
    };
    const auto samples = follow(make, held, at, 11 * cycle + 0.002);
    const auto ticks = static_cast<std::size_t>(std::lround(cycle / kTickSeconds));
    ASSERT_GT(samples.size(), 11 * ticks);
    const HandTick& first = samples[ticks];
    const HandTick& last = samples[11 * ticks];
    most = std::max(most, last.given - first.given - (last.damped - first.damped));
  }
  EXPECT_LE(most, 1e-4);
  std::printf(
      "%-8s %-16s at %-8s %7.1f N/m, at rest %.3f um (server) %.3f um (station), sinking %.2f um, work %.4f "
      "mJ\n",
      make.name, contact.part, contact.name, slope, rangeOf(resting) * 1e6, rangeOf(resting_local) * 1e6,
      rangeOf(along) * 1e6, most * 1e3);
}

INSTANTIATE_TEST_SUITE_P(
    Devices, StiffHandInBayNightly,
    testing::Combine(
        testing::Values(kHug, kSigma, kFalcon),
        testing::Values(BayContact{"control_box", "fender", {0.946, 0.75, 0.80}, {-1.0, 0.0, 0.0}},
                        BayContact{"bracket", "flange", {0.87, 1.00, 0.93}, {0.0, 0.0, -1.0}},
                        BayContact{"covering_board", "bumper", {0.0, 0.042, 0.195}, {0.0, 1.0, 0.0}},
                        BayContact{"drill", "flange", {0.87, 1.00, 0.93}, {0.0, 0.0, -1.0}})),
    [](const auto& one) {
      const BayContact& contact = std::get<1>(one.param);
      return std::string(std::get<0>(one.param).name) + "_" + contact.part + "_" + contact.name;
    });

}  // namespace
}  // namespace tenon::rehearse
