#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"

namespace tenon {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::floorStructures;
using test::IslandRig;
using test::StructuresPtr;

constexpr double kPeriod = 1e-3;                  // [s] the wrench is held so long
constexpr int kFine = 20;                         // parts of a period in which work is counted
constexpr double kOwnDamping = 5.0;               // [Ns/m] the device's
constexpr double kOwnRotationalDamping = 0.0125;  // [Nms/rad]
constexpr double kStiffness = 0.8 * 2.0 * kOwnDamping / kPeriod;                      // 8 kN/m
constexpr double kRotationalStiffness = 0.8 * 2.0 * kOwnRotationalDamping / kPeriod;  // 20 Nm/rad
constexpr double kEncoderStep = 1e-4;                                                 // [m]
constexpr double kAngleStep = 0.1 * std::numbers::pi / 180.0;                         // [rad]
constexpr double kBudget = 1e-4;                                                      // [J]

Vector3 read(const Vector3& x, double step) { return (x / step).array().round() * step; }

enum class Around { kFloor, kCorner, kEdge };

struct Loop {
  const char* name;
  Around around;
  double frequency;     // [Hz]
  Vector3 middle;       // of the hand's way [m]
  Vector3 way, aside;   // [m] cosine and sine part of it
  Vector3 turn, twist;  // [rad] likewise, of its turn
};

class CouplingWork : public testing::TestWithParam<Loop> {
 protected:
  CouplingWork() {
    // the box's lower side on the floor is its origin's height of 10.5 mm
    box_ = rig_.addBody(boxStructures({0.04, 0.04, 0.02}, 0.001, 0.002), Pose(Vector3(0.04, 0.04, 0.05)),
                        kStiffness, kRotationalStiffness);
    const double dilation = 0.0005;
    if (GetParam().around == Around::kFloor)
      rig_.addStatic(box_, floorStructures(0.3, 0.001), Pose(), dilation);
    if (GetParam().around == Around::kCorner)
      rig_.addStatic(box_, cornerStructures(0.12, 0.001), Pose(), dilation);
    if (GetParam().around == Around::kEdge) {
      const StructuresPtr edge = boxStructures({0.15, 0.05, 0.05}, 0.001, 0.002);
      const Pose X_WE(Vector3(0.0, 0.0, -std::sqrt(0.5) * 0.05),
                      expRotation({0.25 * std::numbers::pi, 0.0, 0.0}));
      rig_.addStatic(box_, edge, X_WE, dilation);
      rig_.addStaticShell(box_, edge, X_WE, dilation);
    }
  }
  [[nodiscard]] static Pose handAt(double t) {
    const Loop& loop = GetParam();
    const double phase = 2.0 * std::numbers::pi * loop.frequency * t;
    const double c = std::cos(phase);
    const double s = std::sin(phase);
    return {loop.middle + c * loop.way + s * loop.aside, expRotation(c * loop.turn + s * loop.twist)};
  }
  /// The wrench on the hand about its own origin, of what its encoders say.
  Wrench feel(const Pose& X_WH) {
    const Pose X_WR(read(X_WH.translation(), kEncoderStep),
                    expRotation(read(logRotation(X_WH.rotation()), kAngleStep)));
    rig_.setHand(box_, X_WR);
    rig_.step();
    const Displacement stretch = displacement(X_WR, rig_.pose(box_));
    return {kStiffness * stretch.translation, kRotationalStiffness * stretch.rotation};
  }

  IslandRig rig_;
  std::size_t box_ = 0;
};

//   |  o  )   the hand goes round and turns to and fro, in and out of contact, again and again: it is given
//  ~~~~~~~    no more energy than the device's own damping takes
TEST_P(CouplingWork, IsNotMoreThanTheDevicesOwnDampingTakesOverAClosedLoop) {
  const int cycle = static_cast<int>(std::lround(1.0 / (GetParam().frequency * kPeriod)));
  rig_.moveHand(box_, handAt(0.0), 200);
  double given = 0.0;      // [J] to the hand, less what the device's own damping took
  double strongest = 0.0;  // [Nm]
  for (int tick = 0; tick < 6 * cycle; ++tick) {
    const double t = tick * kPeriod;
    const Wrench F_H_W = feel(handAt(t));
    strongest = std::max(strongest, F_H_W.torque.norm());
    if (tick < cycle) continue;  // a whole cycle first, so that the loop begins as it ends
    for (int i = 0; i < kFine; ++i) {
      const Displacement way =
          displacement(handAt(t + i * kPeriod / kFine), handAt(t + (i + 1) * kPeriod / kFine));
      given += F_H_W.force.dot(way.translation) + F_H_W.torque.dot(way.rotation);
      given -=
          (kOwnDamping * way.translation.squaredNorm() + kOwnRotationalDamping * way.rotation.squaredNorm()) *
          kFine / kPeriod;
    }
  }
  EXPECT_LE(given, kBudget);
  EXPECT_GE(strongest, 0.03) << "it does turn against something";
  RecordProperty("given_uJ", static_cast<int>(std::lround(given * 1e6)));
}

const Vector3 kNone = Vector3::Zero();
INSTANTIATE_TEST_SUITE_P(
    GodObject, CouplingWork,
    testing::Values(
        Loop{"RockingSlowly", Around::kFloor, 0.5, {0.0, 0.0, 0.009}, kNone, kNone, {0.1, 0.0, 0.0}, kNone},
        Loop{"RockingQuickly", Around::kFloor, 5.0, {0.0, 0.0, 0.009}, kNone, kNone, {0.05, 0.0, 0.0}, kNone},
        Loop{"WobblingLikeACoin",
             Around::kFloor,
             2.0,
             {0.0, 0.0, 0.01},
             kNone,
             kNone,
             {0.1, 0.0, 0.0},
             {0.0, 0.1, 0.0}},
        Loop{"WobblingAndTwisting",
             Around::kFloor,
             2.0,
             {0.0, 0.0, 0.01},
             {0.002, 0.0, 0.001},
             {0.0, 0.002, 0.0},
             {0.08, 0.0, 0.1},
             {0.0, 0.08, 0.0}},
        Loop{"OfAnEncoderStep",
             Around::kFloor,
             10.0,
             {0.0, 0.0, 0.0095},
             kNone,
             kNone,
             {0.0012, 0.0, 0.0},
             {0.0, 0.0012, 0.0}},
        Loop{"InAndOutOfContact",
             Around::kFloor,
             2.0,
             {0.0, 0.0, 0.0125},
             {0.0, 0.0, 0.003},
             kNone,
             {0.0, 0.1, 0.0},
             {0.1, 0.0, 0.0}},
        Loop{"InACorner",
             Around::kCorner,
             2.0,
             {0.02, 0.02, 0.01},
             {0.001, 0.0, 0.0},
             {0.0, 0.001, 0.001},
             {0.05, 0.0, 0.05},
             {0.0, 0.05, 0.0}},
        Loop{"RockingOnAnEdge",
             Around::kEdge,
             2.0,
             {0.0, 0.0, 0.009},
             kNone,
             kNone,
             {0.1, 0.0, 0.0},
             {0.0, 0.1, 0.0}}),
    [](const auto& one) { return std::string(one.param.name); });

//  hand turned by a little, the box stays flat on the floor: torque over turn
TEST(CouplingStiffness, IsShownWithinAPercentInTurning) {
  for (const double stiffness : {2.0, 20.0}) {
    IslandRig rig;
    const auto box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.001, 0.002),
                                 Pose(Vector3(0.0, 0.0, 0.02)), kStiffness, stiffness);
    rig.addStatic(box, floorStructures(0.3, 0.001), Pose(), 0.0005);
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
}  // namespace tenon
