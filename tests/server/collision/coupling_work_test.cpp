#include <algorithm>
#include <cmath>
#include <numbers>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::floorStructures;
using test::IslandRig;
using test::StructuresPtr;

constexpr double kPeriod = 1e-3;                                     // [s] the wrench is constant for
constexpr int kWorkSteps = 20;                                       // a period, to integrate the work
constexpr double kDeviceDamping = 5.0;                               // [Ns/m] physical damping of the device
constexpr double kDeviceRotationalDamping = 0.0125;                  // [Nms/rad]
constexpr double kStiffness = 0.8 * 2.0 * kDeviceDamping / kPeriod;  // 8 kN/m
constexpr double kRotationalStiffness = 0.8 * 2.0 * kDeviceRotationalDamping / kPeriod;  // 20 Nm/rad
constexpr double kEncoderStep = 1e-4;                                                    // [m]
constexpr double kAngleStep = 0.1 * std::numbers::pi / 180.0;                            // [rad]
constexpr double kWorkTolerance = 1e-4;                                                  // [J]

Vector3 quantised(const Vector3& x, double step) { return (x / step).array().round() * step; }

enum class Obstacle { kFloor, kCorner, kEdge };

struct CoupledHandLoop {
  const char* name;
  Obstacle obstacle;
  double frequency;                // [Hz]
  Vector3 centre;                  // [m] of the hand's path
  Vector3 cosine, sine;            // [m] amplitudes of its position
  Vector3 turn_cosine, turn_sine;  // [rad] amplitudes of its rotation vector
};
void PrintTo(const CoupledHandLoop& loop, std::ostream* out) { *out << loop.name; }

class CouplingWork : public testing::TestWithParam<CoupledHandLoop> {
 protected:
  CouplingWork() {
    // with its lower side on the floor the box's origin is 10.5 mm high
    box_ = rig_.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.001, 0.002),
                        Pose(Vector3(0.04, 0.04, 0.05)), kStiffness, kRotationalStiffness);
    const double dilation = 0.0005;
    if (GetParam().obstacle == Obstacle::kFloor)
      rig_.addStatic(box_, test::floorStructures(0.3, 0.001), Pose(), dilation);
    if (GetParam().obstacle == Obstacle::kCorner)
      rig_.addStatic(box_, test::cornerStructures(0.12, 0.001), Pose(), dilation);
    if (GetParam().obstacle == Obstacle::kEdge) {
      const test::StructuresPtr edge = test::boxStructures({0.15, 0.05, 0.05}, 0.001, 0.002);
      const Pose X_WE(Vector3(0.0, 0.0, -std::sqrt(0.5) * 0.05),
                      expRotation({0.25 * std::numbers::pi, 0.0, 0.0}));
      rig_.addStatic(box_, edge, X_WE, dilation);
      rig_.addStaticShell(box_, edge, X_WE, dilation);
    }
  }
  [[nodiscard]] static Pose handAt(double t) {
    const CoupledHandLoop& loop = GetParam();
    const double phase = 2.0 * std::numbers::pi * loop.frequency * t;
    const double c = std::cos(phase);
    const double s = std::sin(phase);
    return {loop.centre + c * loop.cosine + s * loop.sine,
            expRotation(c * loop.turn_cosine + s * loop.turn_sine)};
  }
  /// [N, Nm] The wrench on the hand about its origin, in W, for the pose that its encoders measure.
  Wrench wrenchOnHand(const Pose& X_WH) {
    const Pose X_WR(quantised(X_WH.translation(), kEncoderStep),
                    expRotation(quantised(logRotation(X_WH.rotation()), kAngleStep)));
    rig_.setHand(box_, X_WR);
    rig_.step();
    const Displacement stretch = displacement(X_WR, rig_.pose(box_));
    return {kStiffness * stretch.translation, kRotationalStiffness * stretch.rotation};
  }

  test::IslandRig rig_;
  std::size_t box_ = 0;
};

//   |  o  )   the hand moves and rotates in a closed loop, in and out of contact: the coupling gives it
//  ~~~~~~~    no more energy than the device's physical damping dissipates (passivity)
TEST_P(CouplingWork, IsNotMoreThanTheDevicesDampingDissipatesOverAClosedLoop) {
  const int cycle = static_cast<int>(std::lround(1.0 / (GetParam().frequency * kPeriod)));
  rig_.moveHand(box_, handAt(0.0), 200);
  double given = 0.0;           // [J] to the hand, less what the device's damping dissipated
  double largest_torque = 0.0;  // [Nm]
  for (int tick = 0; tick < 6 * cycle; ++tick) {
    const double t = tick * kPeriod;
    const Wrench F_H_W = wrenchOnHand(handAt(t));
    largest_torque = std::max(largest_torque, F_H_W.torque.norm());
    if (tick < cycle) continue;  // the first cycle reaches the periodic state
    for (int i = 0; i < kWorkSteps; ++i) {
      const Displacement path =
          displacement(handAt(t + i * kPeriod / kWorkSteps), handAt(t + (i + 1) * kPeriod / kWorkSteps));
      given += F_H_W.force.dot(path.translation) + F_H_W.torque.dot(path.rotation);
      given -= (kDeviceDamping * path.translation.squaredNorm() +
                kDeviceRotationalDamping * path.rotation.squaredNorm()) *
               kWorkSteps / kPeriod;
    }
  }
  EXPECT_LE(given, kWorkTolerance);
  EXPECT_GE(largest_torque, 0.03) << "no contact resists the rotation";
  RecordProperty("given_uJ", static_cast<int>(std::lround(given * 1e6)));
}

const Vector3 kNone = Vector3::Zero();
INSTANTIATE_TEST_SUITE_P(
    GodObject, CouplingWork,
    testing::Values(
        CoupledHandLoop{
            "RockingSlowly", Obstacle::kFloor, 0.5, {0.0, 0.0, 0.009}, kNone, kNone, {0.1, 0.0, 0.0}, kNone},
        CoupledHandLoop{"RockingQuickly",
                        Obstacle::kFloor,
                        5.0,
                        {0.0, 0.0, 0.009},
                        kNone,
                        kNone,
                        {0.05, 0.0, 0.0},
                        kNone},
        CoupledHandLoop{"PrecessingLikeACoin",
                        Obstacle::kFloor,
                        2.0,
                        {0.0, 0.0, 0.01},
                        kNone,
                        kNone,
                        {0.1, 0.0, 0.0},
                        {0.0, 0.1, 0.0}},
        CoupledHandLoop{"PrecessingAndTwisting",
                        Obstacle::kFloor,
                        2.0,
                        {0.0, 0.0, 0.01},
                        {0.002, 0.0, 0.001},
                        {0.0, 0.002, 0.0},
                        {0.08, 0.0, 0.1},
                        {0.0, 0.08, 0.0}},
        CoupledHandLoop{"OfOneEncoderStep",
                        Obstacle::kFloor,
                        10.0,
                        {0.0, 0.0, 0.0095},
                        kNone,
                        kNone,
                        {0.0012, 0.0, 0.0},
                        {0.0, 0.0012, 0.0}},
        CoupledHandLoop{"InAndOutOfContact",
                        Obstacle::kFloor,
                        2.0,
                        {0.0, 0.0, 0.0125},
                        {0.0, 0.0, 0.003},
                        kNone,
                        {0.0, 0.1, 0.0},
                        {0.1, 0.0, 0.0}},
        CoupledHandLoop{"InACorner",
                        Obstacle::kCorner,
                        2.0,
                        {0.02, 0.02, 0.01},
                        {0.001, 0.0, 0.0},
                        {0.0, 0.001, 0.001},
                        {0.05, 0.0, 0.05},
                        {0.0, 0.05, 0.0}},
        CoupledHandLoop{"RockingOnAnEdge",
                        Obstacle::kEdge,
                        2.0,
                        {0.0, 0.0, 0.009},
                        kNone,
                        kNone,
                        {0.1, 0.0, 0.0},
                        {0.0, 0.1, 0.0}}),
    [](const auto& one) { return std::string(one.param.name); });

//  the hand turns a little, the box stays flat on the floor: change of torque over change of angle
TEST(CouplingStiffness, RotationalStiffnessIsRenderedWithinOnePercent) {
  for (const double stiffness : {2.0, 20.0}) {
    test::IslandRig rig;
    const auto box = rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.001, 0.002),
                                 Pose(Vector3(0.0, 0.0, 0.02)), kStiffness, stiffness);
    rig.addStatic(box, test::floorStructures(0.3, 0.001), Pose(), 0.0005);
    const auto torqueAt = [&](double turn) {
      rig.moveHand(box, Pose(Vector3(0.0, 0.0, -0.01), expRotation({turn, 0.0, 0.0})), 50);
      rig.settle(20);
      return springWrench(rig.body(box).springs[0], rig.pose(box)).torque.x();
    };
    const double slope = (torqueAt(0.03) - torqueAt(0.01)) / 0.02;
    EXPECT_NEAR(slope, stiffness, 0.01 * stiffness);
  }
}

}  // namespace
}  // namespace tenon::collision
