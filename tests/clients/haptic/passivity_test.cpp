#include <cmath>
#include <numbers>
#include <ostream>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "tests/clients/haptic/plane_server.h"

namespace tenon::haptic {
namespace {

constexpr double kPeriod = 1e-3;          // [s] of the zero-order hold
constexpr int kSubsteps = 50;             // [-] of a period, for the integration of work
constexpr double kPhysicalDamping = 5.0;  // [Ns/m] of the device
constexpr double kEncoderStep = 1e-4;     // [m]
constexpr double kVirtualDamping = 1.0;   // [Ns/m] a fifth of the physical damping
constexpr double kFloorTouch = 0.012;     // [m] height of the hand at contact: the ball's radius
constexpr double kTolerance = 1e-4;       // [J]

double quantize(double x) { return kEncoderStep * std::round(x / kEncoderStep); }

struct HandLoop {
  const char* name;
  double frequency;  // [Hz]
  double amplitude;  // [m] vertical, about the height of contact
  double sideways;   // [m] horizontal, a quarter period later: an ellipse
};

void PrintTo(const HandLoop& loop, std::ostream* out) { *out << loop.name; }

/// A spring and a damper that use up the physical damping b: K T / 2 + B = b.
struct SpringDamper {
  const char* name;
  double share;    ///< [-] of the damping that the spring uses
  double damping;  ///< [Ns/m] B
};

void PrintTo(const SpringDamper& coupling, std::ostream* out) { *out << coupling.name; }

class PassivityOf : public testing::TestWithParam<std::tuple<HandLoop, SpringDamper>> {};

//     o   the hand moves periodically through the floor; the energy delivered to it is not more than the
//   ~( )~ physical damping of the device dissipates
TEST_P(PassivityOf, DeliversNoEnergyOverAClosedLoop) {
  const auto& [loop, spring] = GetParam();
  const double stiffness = spring.share * 2.0 * kPhysicalDamping / kPeriod;
  const test::PlaneServer server(stiffness);
  WorldView world;
  world.begin(server.objects(), 0, 0);
  LocalModel model;
  Coupling coupling({.max_stiffness = stiffness, .damping = spring.damping});

  const auto handAt = [&loop = loop](double t) {
    const double phase = 2.0 * std::numbers::pi * loop.frequency * t;
    return Vector3(loop.sideways * std::sin(phase), 0.0, kFloorTouch + loop.amplitude * std::cos(phase));
  };
  const int cycle = static_cast<int>(std::lround(1.0 / (loop.frequency * kPeriod)));
  double delivered = 0.0;  // [J] to the hand, less the dissipation of the physical damping
  for (int tick = 0; tick < 10 * cycle; ++tick) {
    const double t = tick * kPeriod;
    const Vector3 p = handAt(t);
    const Pose X_WH(Vector3(quantize(p.x()), quantize(p.y()), quantize(p.z())));
    world.receive(server.frame(static_cast<Tick>(tick + 1)));
    model.receive(server.manifold(static_cast<Tick>(tick + 1), X_WH));
    const Vector3 force = coupling.step(model.step(X_WH, world), X_WH, kPeriod).force;
    if (tick < cycle) continue;  // the first cycle removes the transient
    for (int i = 0; i < kSubsteps; ++i) {
      const Vector3 dp = handAt(t + (i + 1) * kPeriod / kSubsteps) - handAt(t + i * kPeriod / kSubsteps);
      delivered += force.dot(dp) - kPhysicalDamping * dp.squaredNorm() * kSubsteps / kPeriod;
    }
  }
  EXPECT_LE(delivered, kTolerance);
  RecordProperty("delivered_uJ", static_cast<int>(std::lround(delivered * 1e6)));
}

INSTANTIATE_TEST_SUITE_P(
    Coupling, PassivityOf,
    testing::Combine(
        testing::Values(HandLoop{"Slow", 0.5, 0.003, 0.0}, HandLoop{"Medium", 2.0, 0.003, 0.0},
                        HandLoop{"Fast", 10.0, 0.002, 0.0}, HandLoop{"Tremor", 25.0, 0.0005, 0.0},
                        HandLoop{"SmallerThanAnEncoderStep", 20.0, 0.00004, 0.0},
                        HandLoop{"Ellipse", 2.0, 0.003, 0.01}, HandLoop{"FastEllipse", 10.0, 0.002, 0.002}),
        testing::Values(SpringDamper{"Damped", 0.8, kVirtualDamping}, SpringDamper{"Stiff", 1.0, 0.0})),
    [](const auto& one) { return std::string(std::get<0>(one.param).name) + std::get<1>(one.param).name; });

TEST(Coupling, RendersItsStiffnessWithinOnePercentOverItsRange) {
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
}  // namespace tenon::haptic
