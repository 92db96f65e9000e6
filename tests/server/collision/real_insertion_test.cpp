#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"
#include "tests/server/collision/real_parts.h"
#include "tests/support/sanitized.h"

namespace tenon {
namespace {

using test::bakePart;
using test::boxAboutAxis;
using test::dilationOf;
using test::IslandRig;
using test::overlapOfMeshes;
using test::RealPart;
using test::voxelOf;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kTilt = 0.035;    // 2 degrees
constexpr double kWrist = 1.4;     // [Nm/rad] a coupling of 20 behind a relaxed wrist of 1.5
constexpr double kOverlap = 5e-6;  // [m] of the meshes themselves, at most
constexpr int kLookEvery = 20;     // ticks

const Quaternion kAskew = expRotation({kTilt, 0.0, 0.0});

double tiltOf(const Pose& X_WB) { return std::acos(std::min((X_WB.rotation() * Vector3::UnitZ()).z(), 1.0)); }

/// A part in a hand that meets others: what the hand feels, and now and then how deep one mesh is in another,
/// whatever their fields say.
class Insertion {
 public:
  /// A hand's grip is at `p_BH`.
  std::size_t hold(const RealPart& part, const Pose& X_WB, const Vector3& p_BH) {
    held_ = rig.addBody(part.structures, X_WB, 1000.0, kWrist);
    rig.holdAt(held_, p_BH);
    return held_;
  }
  /// What stands where its file says, asked both ways.
  void stand(std::size_t body, const RealPart& part, double play) {
    rig.addStatic(body, part.structures, Pose(), dilationOf(play));
    rig.addStaticShell(body, part.structures, Pose(), dilationOf(play));
  }
  /// `overlap` says how deep meshes are in each other now.
  void watch(std::function<double()> overlap) { overlap_ = std::move(overlap); }

  void step(const Pose& X_WH) {
    rig.setHand(held_, X_WH);
    rig.step();
    strongest = std::max(strongest, force());
    if (ticks_++ % kLookEvery == 0) deepest_ = std::max(deepest_, overlap_());
  }
  /// What the hand feels.
  [[nodiscard]] double force() const {
    return springWrench(rig.body(held_).springs[0], rig.pose(held_)).force.norm();
  }
  void expectGentle() const {
    EXPECT_LE(strongest, 5.0);
    EXPECT_EQ(deepest_, 0.0);
    EXPECT_GE(rig.deepest_overlap, -1e-5);
    EXPECT_EQ(rig.conflicts, 0);
    testing::Test::RecordProperty("strongest_mN", static_cast<int>(std::lround(1e3 * strongest)));
  }

  IslandRig rig;
  double strongest = 0.0;  ///< [N]

 private:
  std::size_t held_ = 0;
  std::function<double()> overlap_;
  double deepest_ = 0.0;  ///< [m]
  int ticks_ = 0;
};

struct PegCase {
  const char* name;
  const char* hole;
  const char* peg;
  double play;  ///< [m] the hole is wider than the peg
  double half;  ///< [m] of the hole's longer side, and what is refined about it
};

class RealPegs : public testing::TestWithParam<PegCase> {};

//        |  |  2 degrees askew, a third of a millimetre beside
//  ----  ~|  |~~    a sheet of no thickness stands beside the block with the hole
TEST_P(RealPegs, TheSheetHoldsThePegAndTheHoleTakesItInAskewAndGivesItBack) {
  const PegCase& one = GetParam();
  if (!std::filesystem::exists(test::pairsFolder() / one.hole)) GTEST_SKIP() << "no CAD pairs (TENON_SHARED)";
  if (test::kSanitized) GTEST_SKIP() << "takes minutes; CAD pairs are baked and asked by other tests";
  constexpr double kHoleTop = 0.009;
  constexpr double kSheetVoxel = 0.003;
  constexpr double kSheetX = -0.06;
  const double fine = voxelOf(one.play);
  const auto hole = bakePart(one.hole, fine, {boxAboutAxis(0.0, one.half, -0.0005, 0.0095)}, 0.0005);
  const auto peg = bakePart(one.peg, fine, {boxAboutAxis(0.0, one.half, -0.0005, 0.0105)}, 0.0005);
  ASSERT_TRUE(hole && peg);

  Insertion insertion;
  IslandRig& rig = insertion.rig;
  const Pose start(Vector3(kSheetX, 0.0, 0.02), kAskew);
  const auto held = insertion.hold(*peg, start, {0.0, 0.0, 0.02});
  insertion.stand(held, *hole, one.play);
  rig.addStatic(held, test::sheetStructures(0.04, 0.0, kSheetVoxel, 0.0011), Pose(Vector3(kSheetX, 0.0, 0.0)),
                test::kSolidVoxels * kSheetVoxel);
  insertion.watch([&] { return overlapOfMeshes(*peg, *hole, rig.pose(held), kOverlap); });
  const auto go = [&](const Pose& X_WH, int ticks) {
    const Pose from = rig.body(held).springs[0].X_WG;
    for (int tick = 1; tick <= ticks; ++tick) {
      const Displacement way = displacement(from, X_WH);
      const double share = static_cast<double>(tick) / ticks;
      insertion.step(displaced(from, {share * way.translation, share * way.rotation}));
    }
  };

  // onto the sheet at 1 m/s, to 30 mm behind it
  go(Pose(Vector3(kSheetX, 0.0, -0.03), kAskew), 50);
  rig.settle(20);
  EXPECT_GT(rig.pose(held).translation().z(), 0.0011) << "through the sheet";
  EXPECT_GT(rig.force(2).force.z(), 20.0);
  go(start, 50);
  // over to the block, along it until the tip finds the hole, in, and out again
  insertion.strongest = 0.0;
  go(Pose(Vector3(0.0003, -0.00015, 0.012), kAskew), 200);
  go(Pose(Vector3(0.0003, -0.00015, 0.0085), kAskew), 100);
  go(Pose(Vector3(0.0, 0.0, 0.0085), kAskew), 100);
  go(Pose(Vector3(0.0, 0.0, 0.0), kAskew), 400);
  rig.settle(10);
  EXPECT_NEAR(rig.pose(held).translation().z(), 0.0, 0.0005) << "not in";
  EXPECT_LE(tiltOf(rig.pose(held)), one.play / kHoleTop) << "the hole turns it straight";
  go(Pose(Vector3(0.0003, 0.0, 0.02), kAskew), 500);
  EXPECT_NEAR(rig.pose(held).translation().z(), 0.02, 1e-6) << "not out";
  const Pose aside(Vector3(one.play, 0.0, 0.0));
  EXPECT_NEAR(overlapOfMeshes(*peg, *hole, aside, kOverlap), 0.5 * one.play, 0.1 * one.play)
      << "blind witness";
  insertion.expectGentle();
}

INSTANTIATE_TEST_SUITE_P(
    Factory, RealPegs,
    testing::Values(PegCase{"Round8", "nv_factory_round_8mm/factory_round_hole_8mm_subdiv_3x.obj",
                            "nv_factory_round_8mm/factory_round_peg_8mm_loose.obj", 0.000114, 0.0043},
                    PegCase{"Rectangular16",
                            "nv_factory_rect_16mm/factory_rectangular_hole_16mm_subdiv_3x.obj",
                            "nv_factory_rect_16mm/factory_rectangular_peg_16mm_loose_subdiv_3x.obj", 0.000248,
                            0.0085}),
    [](const auto& one) { return std::string(one.param.name); });

//   [nut]  <- the hand turns it and presses a little; the thread alone leads it down, 2 mm a turn
//    ~~
//   bolt
TEST(RealThread, ANutPutOnAskewIsScrewedDownAndUpAgain) {
  const std::string folder = "nv_factory_nut_bolt_m16/";
  if (!std::filesystem::exists(test::pairsFolder() / folder)) GTEST_SKIP() << "no CAD pairs (TENON_SHARED)";
  if (test::kSanitized) GTEST_SKIP() << "takes minutes; CAD pairs are baked and asked by other tests";
  constexpr double kPitch = 0.002;
  constexpr double kPlay = 0.0002;  // 0.1 mm on either flank
  constexpr double kTop = 0.025;    // the nut's lift where it leaves the bolt's tip
  constexpr int kTurnTicks = 628;
  constexpr int kTurns = 3;
  const Vector3 p_NC(0.0, 0.0, 0.0225);  // its middle
  const double fine = voxelOf(kPlay);
  const auto bolt = bakePart(folder + "factory_bolt_m16_loose.obj", fine,
                             {boxAboutAxis(0.0, 0.0085, 0.0355, 0.0415)}, 0.0005);
  const auto nut = bakePart(folder + "factory_nut_m16_loose_subdiv_3x.obj", fine,
                            {boxAboutAxis(0.0, 0.0085, 0.0155, 0.0215)}, 0.0005);
  ASSERT_TRUE(bolt && nut);

  Insertion insertion;
  IslandRig& rig = insertion.rig;
  // lifted, turned about the bolt's axis, then askew about its middle
  const auto placed = [&p_NC](double lift, double turn, double tilt) {
    const Quaternion q = expRotation({tilt, 0.0, 0.0}) * expRotation({0.0, 0.0, turn});
    return Pose(Vector3(0.0002, -0.0001, lift) + p_NC - q * p_NC, q);
  };
  const auto held = insertion.hold(*nut, placed(0.0265, 0.0, kTilt), p_NC);
  insertion.stand(held, *bolt, kPlay);
  insertion.watch([&] { return overlapOfMeshes(*nut, *bolt, rig.pose(held), kOverlap); });
  const auto lift = [&] { return (rig.pose(held) * p_NC - p_NC).z(); };
  const auto step = [&insertion](const Pose& X_WH) { insertion.step(X_WH); };

  constexpr double kPress = 0.002;  // the hand ahead of the thread: 2 N
  for (int tick = 1; tick <= 150; ++tick) step(placed(0.0265 - 0.0035 * tick / 150.0, 0.0, kTilt));
  for (int tick = 1; tick <= kTurns * kTurnTicks; ++tick) {
    const double turns = static_cast<double>(tick) / kTurnTicks;
    step(placed(kTop - kPress - kPitch * turns, -kTurn * turns, kTilt * std::max(1.0 - turns, 0.0)));
    if (turns < kTurns - 1) continue;
    // at the files' own pose turned back to 0 the flanks of both are a whole number of pitches apart
    const double off_thread = std::remainder(lift() + kPitch * turns, kPitch);
    ASSERT_LE(std::abs(off_thread), 0.5 * kPlay) << "beside the thread after turns: " << turns;
    ASSERT_LE(tiltOf(rig.pose(held)), 0.01);
  }
  EXPECT_LE(lift(), kTop - kPitch * (kTurns - 1)) << "not on";
  constexpr double kOff = kTurns + 0.5;
  const double deep = lift();
  for (int tick = 1; tick <= static_cast<int>(kOff * kTurnTicks); ++tick) {
    const double turns = static_cast<double>(tick) / kTurnTicks;
    step(placed(deep + kPitch * turns + 0.5 * kPress, kTurn * (turns - kTurns), 0.0));
  }
  for (int tick = 1; tick <= 100; ++tick) {
    step(placed(deep + kPitch * kOff + 0.5 * kPress + 0.004 * tick / 100.0, 0.5 * kTurn, 0.0));
  }
  EXPECT_EQ(insertion.force(), 0.0) << "not off";
  insertion.expectGentle();
}

//      |#|   the small gear goes on its shaft askew, its teeth between those of the medium one,
//  ##|##|#|  which turns freely on its own; turned, it turns the other half as far; then it comes off
//  ________
TEST(RealGears, AGearGoesOnItsShaftTurnsItsNeighbourAndComesOff) {
  const std::string folder = "nv_factory_gears/";
  if (!std::filesystem::exists(test::pairsFolder() / folder)) GTEST_SKIP() << "no CAD pairs (TENON_SHARED)";
  if (test::kSanitized) GTEST_SKIP() << "takes minutes; CAD pairs are baked and asked by other tests";
  constexpr double kBorePlay = 0.000027;
  constexpr double kToothPlay = 0.00037;
  constexpr double kHigh = 0.0225;        // of what is off the shaft
  constexpr double kBacklash = 0.0185;    // [rad] of the small gear, to either side
  const Vector3 p_WM(0.020, 0.0, 0.015);  // middles of both as they sit, in the files' common frame
  const Vector3 p_WS(0.0505, 0.0, 0.015);
  // shafts and bores are thick, so their samples need not be as close as the play is small
  const double fine = voxelOf(kToothPlay);
  const double shaft = 0.0056;
  const auto base = bakePart(
      folder + "factory_gear_base_loose_space_5e-4_subdiv_4x.obj", fine,
      {boxAboutAxis(p_WM.x(), shaft, 0.0045, 0.0255), boxAboutAxis(p_WS.x(), shaft, 0.0045, 0.0255)}, 0.001);
  const auto medium = bakePart(
      folder + "factory_gear_medium_space_5e-4.obj", fine,
      {boxAboutAxis(p_WM.x(), shaft, 0.0045, 0.0255), boxAboutAxis(0.039, 0.007, 0.0045, 0.0155)}, 0.0008);
  const auto small = bakePart(
      folder + "factory_gear_small_space_5e-4.obj", fine,
      {boxAboutAxis(p_WS.x(), 0.0115, 0.0045, 0.0155), boxAboutAxis(p_WS.x(), shaft, 0.0045, 0.0255)},
      0.0008);
  ASSERT_TRUE(base && medium && small);

  Insertion insertion;
  IslandRig& rig = insertion.rig;
  const auto placed = [&p_WS](double high, const Vector3& beside, const Quaternion& q) {
    return Pose(Vector3(0.0, 0.0, high) + beside + p_WS - q * p_WS, q);
  };
  const Vector3 kBeside(0.0002, -0.0001, 0.0);
  const auto turning = rig.addBody(medium->structures, Pose(), 200.0, 0.0);
  rig.holdAt(turning, p_WM);
  const auto held = insertion.hold(*small, placed(kHigh, kBeside, kAskew), p_WS);
  for (const auto body : {turning, held}) insertion.stand(body, *base, kBorePlay);
  rig.addPair(held, turning, dilationOf(kToothPlay));
  rig.addPair(turning, held, dilationOf(kToothPlay));
  insertion.watch([&] {
    const Pose X_TH = rig.pose(turning).inverse() * rig.pose(held);
    return std::max({overlapOfMeshes(*small, *base, rig.pose(held), kOverlap),
                     overlapOfMeshes(*medium, *base, rig.pose(turning), kOverlap),
                     overlapOfMeshes(*small, *medium, X_TH, kOverlap)});
  });
  const auto step = [&insertion](const Pose& X_WH) { insertion.step(X_WH); };

  constexpr int kWayTicks = 500;
  for (int tick = 0; tick <= kWayTicks; ++tick) {
    step(placed(kHigh - (kHigh + 0.001) * tick / kWayTicks, kBeside, kAskew));
  }
  EXPECT_NEAR((rig.pose(held) * p_WS - p_WS).z(), 0.0, 5e-5) << "not on";
  constexpr int kTurnTicks = 600;
  for (int tick = 0; tick <= kTurnTicks; ++tick) {
    const double turn = 0.4 * std::sin(kTurn * tick / kTurnTicks);
    step(placed(-0.0005, Vector3::Zero(), expRotation({0.0, 0.0, turn})));
    const double here = logRotation(rig.pose(held).rotation()).z();
    const double there = logRotation(rig.pose(turning).rotation()).z();
    if (tick > 20) {
      ASSERT_NEAR(here, turn, 0.002) << "the neighbour turns freely";
    }
    ASSERT_LE(std::abs(here + 2.0 * there), kBacklash) << "20 teeth and 40";
  }
  for (int tick = 0; tick <= kWayTicks; ++tick) {
    step(placed((kHigh + 0.001) * tick / kWayTicks - 0.001, kBeside, kAskew));
  }
  EXPECT_EQ(insertion.force(), 0.0) << "not off";
  insertion.expectGentle();
}

}  // namespace
}  // namespace tenon
