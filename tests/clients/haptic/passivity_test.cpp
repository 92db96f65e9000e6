#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "tests/clients/haptic/plane_server.h"

namespace tenon {
namespace {

constexpr double kPeriod = 1e-3;         // [s] the force is held so long
constexpr int kFine = 50;                // parts of a period in which work is counted
constexpr double kOwnDamping = 5.0;      // [Ns/m] the device's
constexpr double kEncoderStep = 1e-4;    // [m]
constexpr double kVirtualDamping = 1.0;  // [Ns/m] a fifth of the device's
constexpr double kFloorTouch = 0.012;    // [m] the ball's radius: where it meets the floor
constexpr double kBudget = 1e-4;         // [J]

double read(double x) { return kEncoderStep * std::round(x / kEncoderStep); }

struct Loop {
  const char* name;
  double frequency;  // [Hz]
  double amplitude;  // [m] about the floor's surface
  double sideways;   // [m] a quarter period later: an ellipse
};

class PassivityOf : public testing::TestWithParam<Loop> {};

//     o   the hand goes round through the floor and comes back to where it was, again and again
//   ~( )~ and is given no more energy than the device's own damping takes
TEST_P(PassivityOf, GivesNoEnergyOverAClosedLoop) {
  const Loop& loop = GetParam();
  const double stiffness = 0.8 * 2.0 * kOwnDamping / kPeriod;
  const test::PlaneServer server(stiffness);
  WorldView world;
  world.begin(server.objects(), 0, 0);
  LocalModel model;
  Coupling coupling({.max_stiffness = stiffness, .damping = kVirtualDamping});

  const auto handAt = [&](double t) {
    const double phase = 2.0 * std::numbers::pi * loop.frequency * t;
    return Vector3(loop.sideways * std::sin(phase), 0.0, kFloorTouch + loop.amplitude * std::cos(phase));
  };
  const int cycle = static_cast<int>(std::lround(1.0 / (loop.frequency * kPeriod)));
  double given = 0.0;  // [J] to the hand, less what the device's own damping took of it
  for (int tick = 0; tick < 10 * cycle; ++tick) {
    const double t = tick * kPeriod;
    const Vector3 p = handAt(t);
    const Pose X_WH(Vector3(read(p.x()), read(p.y()), read(p.z())));
    world.receive(server.frame(static_cast<Tick>(tick + 1)));
    model.receive(server.manifold(static_cast<Tick>(tick + 1), X_WH));
    const Vector3 force = coupling.step(model.step(X_WH, world), X_WH, kPeriod).force;
    if (tick < cycle) continue;  // a whole cycle first, so that the loop begins as it ends
    for (int i = 0; i < kFine; ++i) {
      const Vector3 way = handAt(t + (i + 1) * kPeriod / kFine) - handAt(t + i * kPeriod / kFine);
      given += force.dot(way) - kOwnDamping * way.squaredNorm() * kFine / kPeriod;
    }
  }
  EXPECT_LE(given, kBudget);
  RecordProperty("given_uJ", static_cast<int>(std::lround(given * 1e6)));
}

INSTANTIATE_TEST_SUITE_P(Coupling, PassivityOf,
                         testing::Values(Loop{"Slow", 0.5, 0.003, 0.0}, Loop{"Brisk", 2.0, 0.003, 0.0},
                                         Loop{"Quick", 10.0, 0.002, 0.0}, Loop{"Tremor", 25.0, 0.0005, 0.0},
                                         Loop{"SmallerThanAnEncoderStep", 20.0, 0.00004, 0.0},
                                         Loop{"Round", 2.0, 0.003, 0.01},
                                         Loop{"RoundQuick", 10.0, 0.002, 0.002}),
                         [](const auto& one) { return one.param.name; });

TEST(Coupling, ShowsItsStiffnessWithinAPercentOverItsWholeRange) {
  for (const double stiffness : {200.0, 1000.0, 4000.0, 8000.0}) {
    const test::PlaneServer server(stiffness);
    WorldView world;
    world.begin(server.objects(), 0, 0);
    world.receive(server.frame(1));
    LocalModel model;
    Coupling coupling({.max_stiffness = stiffness, .damping = kVirtualDamping});
    const auto restAt = [&](double depth) {
      const Pose X_WH(Vector3(0.1, 0.0, kFloorTouch - depth));
      double force = 0.0;
      for (Tick tick = 1; tick <= 200; ++tick) {
        model.receive(server.manifold(tick, X_WH));
        force = coupling.step(model.step(X_WH, world), X_WH, kPeriod).force.z();
      }
      return force;
    };
    const double slope = (restAt(0.003) - restAt(0.001)) / 0.002;
    EXPECT_NEAR(slope, stiffness, 0.01 * stiffness);
  }
}

}  // namespace
}  // namespace tenon
