#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "devices/safety.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"

// A hand at the end of its workspace that touches something there:
//
//        |<- wall, a spring of half the passive stiffness towards the centre
//     o  |
//    /###|###  contact, a spring of the passive stiffness along its normal
//        |
//     -> z, away from the centre

namespace tenon::devices {
namespace {

constexpr double kCycle = 1e-3;
constexpr double kTolerance = 2e-4;  // [J]
constexpr double kReach = 1e-3;      // [m] in which the hand moves, on both sides of the edge of the wall

struct NamedDevice {
  std::string name;
  DeviceCaps caps;
};

void PrintTo(const NamedDevice& device, std::ostream* out) { *out << device.name; }

/// A plane that pushes along `normal`; it begins `beyond` [m] outside of the edge of the wall.
struct TouchedPlane {
  const char* name;
  Vector3 normal;
  double beyond;
  double share = 0.0;  ///< [-] of the power that the layer lets pass, which is not taken from the hand before
};

void PrintTo(const TouchedPlane& plane, std::ostream* out) { *out << plane.name; }

class HandAtTheEnd {
 public:
  HandAtTheEnd(const DeviceCaps& caps, const TouchedPlane& plane)
      : plane_(plane), safety_(caps), edge_(0.0, 0.0, safety_.limits().wall_radius) {}

  /// Soft start and slew are over at `p`.
  void settleAt(const Vector3& p) {
    for (int tick = 0; tick < 2200; ++tick) (void)step(p);
  }
  /// Force on a hand that is at `p` [m] from the edge of the wall.
  Vector3 step(const Vector3& p) {
    DeviceState state;
    state.forces_on = true;
    state.X_DH.translation() = edge_ + p;
    SafetyRequest request;
    const double depth = plane_.normal.z() * plane_.beyond - plane_.normal.dot(p);
    request.requested.F_Ho_D.force = safety_.limits().stiffness * std::max(0.0, depth) * plane_.normal;
    request.stiffness = safety_.limits().stiffness;
    return safety_.step(request, state, kCycle).F_Ho_D.force;
  }
  [[nodiscard]] const SafetyLimits& limits() const { return safety_.limits(); }

 private:
  TouchedPlane plane_;
  Safety safety_;
  Vector3 edge_;
};

class WallBesideContactOf : public testing::TestWithParam<std::tuple<NamedDevice, TouchedPlane>> {
 protected:
  const DeviceCaps& caps_ = std::get<0>(GetParam()).caps;
  const TouchedPlane& plane_ = std::get<1>(GetParam());
  HandAtTheEnd hand_{caps_, plane_};
};

/// [m] a closed path of `period` [s] about the edge, `sideways` [m] wide.
Vector3 onPath(double t, double period, double sideways) {
  const double phase = 2.0 * std::numbers::pi * t / period;
  return {sideways * std::sin(phase), 0.0, -kReach * std::cos(phase)};
}

TEST_P(WallBesideContactOf, IsNoStifferThanWhatTheDeviceRendersPassivelyAndHasNoStep) {
  const double slow = hand_.limits().start_force_slew * kCycle + 2.0 * hand_.limits().force_quantum + 1e-9;
  for (const double period : {0.05, 0.4, 3.0}) {
    for (const double sideways : {0.0, 0.5 * kReach, -kReach}) {
      hand_.settleAt(onPath(0.0, period, sideways));
      Vector3 p_last = onPath(0.0, period, sideways);
      Vector3 last = hand_.step(p_last);
      for (double t = 0.0; t < 3.0 * period; t += kCycle) {
        const Vector3 p = onPath(t, period, sideways);
        const Vector3 now = hand_.step(p);
        // 2 %: the wall is a sphere
        ASSERT_LE((now - last).norm(), 1.02 * hand_.limits().stiffness * (p - p_last).norm() + slow)
            << "at " << 1e3 * p.transpose() << " mm, period " << period << " s";
        last = now;
        p_last = p;
      }
    }
  }
}

TEST_P(WallBesideContactOf, PushesTheHandBackNevertheless) {
  const Vector3 inside(0.0, 0.0, -kReach), outside(0.0, 0.0, kReach);
  hand_.settleAt(inside);
  for (double z = -kReach; z < kReach; z += 1e-5) (void)hand_.step({0.0, 0.0, z});
  for (int tick = 0; tick < 1000; ++tick) (void)hand_.step(outside);
  EXPECT_LE(hand_.step(outside).z(),
            -hand_.limits().wall_stiffness * kReach + 2.0 * hand_.limits().force_quantum);
}

TEST_P(WallBesideContactOf, DeliversNoEnergyOverAClosedLoop) {
  for (const double period : {0.05, 0.4, 2.0}) {
    for (const double sideways : {0.0, 0.5 * kReach, -kReach}) {
      hand_.settleAt(onPath(0.0, period, sideways));
      double delivered = 0.0;
      constexpr int kSubsteps = 10;
      for (double t = 0.0; t < 10.0 * period - 0.5 * kCycle; t += kCycle) {
        const Vector3 force = hand_.step(onPath(t, period, sideways));
        for (int i = 0; i < kSubsteps; ++i) {
          const Vector3 dp = onPath(t + (i + 1) * kCycle / kSubsteps, period, sideways) -
                             onPath(t + i * kCycle / kSubsteps, period, sideways);
          delivered += force.dot(dp) - caps_.physical_damping * dp.squaredNorm() * kSubsteps / kCycle;
        }
      }
      EXPECT_LE(delivered, kTolerance + plane_.share * hand_.limits().active_power * 10.0 * period)
          << "period " << period << " s, sideways " << 1e3 * sideways << " mm";
    }
  }
}

/// Safety layer of HUG with a hand that has no contact but the rounding of one, `rounding` [N] outwards.
class FreeHand {
 public:
  /// [N] on a hand at `r` [m] from the centre.
  double step(double r, double rounding) {
    DeviceState state;
    state.forces_on = true;
    state.X_DH.translation() = Vector3(0.0, 0.0, r);
    SafetyRequest request;
    request.requested.F_Ho_D.force = Vector3(0.0, 0.0, rounding);
    request.stiffness = safety_.limits().stiffness;
    return safety_.step(request, state, kCycle).F_Ho_D.force.z();
  }
  [[nodiscard]] const SafetyLimits& limits() const { return safety_.limits(); }

 private:
  Safety safety_{hugArmModel().caps};
};

TEST(WorkspaceWall, IsFeltNowhereWithinItsRadius) {
  for (const double rounding : {0.0, 1e-4, 1.0}) {
    FreeHand hand;
    for (int tick = 0; tick < 2200; ++tick) (void)hand.step(0.0, rounding);
    for (double r = 0.0; r < 0.9 * hand.limits().wall_radius; r += 0.3 * kCycle)
      ASSERT_NEAR(hand.step(r, rounding), rounding, 1e-9) << "at " << r << " m";
  }
}

TEST(WorkspaceWall, IsOfItsWholeStiffnessForAHandWithoutContact) {
  FreeHand hand;
  const double edge = hand.limits().wall_radius;
  for (int tick = 0; tick < 2200; ++tick) (void)hand.step(edge - kReach, 1e-4);
  for (double z = -kReach; z < kReach; z += 0.05 * kCycle) {
    const double expected = -hand.limits().wall_stiffness * std::max(0.0, z);
    ASSERT_NEAR(hand.step(edge + z, 1e-4), expected, 1e-3) << 1e3 * z << " mm beyond";
  }
}

const double kHalf = std::sqrt(0.5);

INSTANTIATE_TEST_SUITE_P(
    Devices, WallBesideContactOf,
    testing::Combine(
        testing::Values(NamedDevice{"hug", hugArmModel().caps}, NamedDevice{"sigma7", sigma7Model().caps},
                        NamedDevice{"omega3", omega3Model().caps}, NamedDevice{"falcon", falconModel().caps}),
        testing::Values(TouchedPlane{"InwardsBefore", {0.0, 0.0, -1.0}, -0.3 * kReach},
                        TouchedPlane{"InwardsBehind", {0.0, 0.0, -1.0}, 0.3 * kReach},
                        TouchedPlane{"ObliquelyInwards", {kHalf, 0.0, -kHalf}, 0.2 * kReach, 0.1},
                        TouchedPlane{"Across", {1.0, 0.0, 0.0}, 0.0},
                        TouchedPlane{"ObliquelyOutwards", {kHalf, 0.0, kHalf}, 0.5 * kReach, 0.1},
                        TouchedPlane{"Outwards", {0.0, 0.0, 1.0}, 0.5 * kReach, 0.1})),
    [](const auto& one) { return std::get<0>(one.param).name + std::get<1>(one.param).name; });

}  // namespace
}  // namespace tenon::devices
