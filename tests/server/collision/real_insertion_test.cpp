#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <ostream>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"
#include "tests/server/collision/real_parts.h"

namespace tenon::collision {
namespace {

using test::bakePart;
using test::boxAboutAxis;
using test::dilationOf;
using test::IslandRig;
using test::overlapOfMeshes;
using test::RealPart;
using test::voxelOf;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kLean = 0.035;       // 2 degrees
constexpr double kWrist = 1.4;        // [Nm/rad] a coupling of 20 in series with a relaxed wrist of 1.5
constexpr double kOverlap = 5e-6;     // [m] tolerance for the overlap of the meshes
constexpr int kOverlapInterval = 20;  // ticks

const Quaternion kTilted = expRotation({kLean, 0.0, 0.0});

double tiltOf(const Pose& X_WB) { return std::acos(std::min((X_WB.rotation() * Vector3::UnitZ()).z(), 1.0)); }

/// A held part that meets static ones: records the force on the hand and, every kOverlapInterval ticks, the
/// exact overlap of the meshes, independent of their fields.
class InsertionTrial {
 public:
  /// Adds a body held by a hand at `p_BH`.
  std::size_t hold(const test::RealPart& part, const Pose& X_WB, const Vector3& p_BH) {
    held_ = rig.addBody(part.structures, X_WB, 1000.0, kWrist);
    rig.holdAt(held_, p_BH);
    return held_;
  }
  /// Adds a static part at its file's pose, with pairs in both directions; `clearance` [m].
  void addStatic(std::size_t body, const test::RealPart& part, double clearance) {
    rig.addStatic(body, part.structures, Pose(), test::dilationOf(clearance));
    rig.addStaticShell(body, part.structures, Pose(), test::dilationOf(clearance));
  }
  /// `overlap` returns the current overlap [m] of the meshes.
  void measureOverlap(std::function<double()> overlap) { measure_overlap_ = std::move(overlap); }

  void step(const Pose& X_WH) {
    rig.setHand(held_, X_WH);
    rig.step();
    largest_force = std::max(largest_force, force());
    if (ticks_++ % kOverlapInterval == 0) overlap_ = std::max(overlap_, measure_overlap_());
  }
  /// [N] On the hand.
  [[nodiscard]] double force() const {
    return springWrench(rig.body(held_).springs[0], rig.pose(held_)).force.norm();
  }
  void expectSmallForcesAndNoOverlap() const {
    EXPECT_LE(largest_force, 5.0);
    EXPECT_EQ(overlap_, 0.0);
    EXPECT_GE(rig.smallest_gap, -1e-5);
    EXPECT_EQ(rig.infeasible_ticks, 0);
    testing::Test::RecordProperty("largest_force_mN", static_cast<int>(std::lround(1e3 * largest_force)));
  }

  test::IslandRig rig;
  double largest_force = 0.0;  ///< [N] on the hand

 private:
  std::size_t held_ = 0;
  std::function<double()> measure_overlap_;
  double overlap_ = 0.0;  ///< [m]
  int ticks_ = 0;
};

struct PegCase {
  const char* name;
  const char* hole;
  const char* peg;
  double clearance;  ///< [m] hole less peg
  double half;  ///< [m] of the finely baked box about the axis: half the hole's longer side, and a margin
};
void PrintTo(const PegCase& one, std::ostream* out) { *out << one.name; }

/// How much work an insertion takes.
struct Effort {
  double fine = 0.0;     ///< [m] voxels within the finely baked box
  double spacing = 0.0;  ///< [m] of the points of hole and peg
  bool sheet = false;    ///< first against a sheet of zero thickness beside the block
};

//         |  |      tilted by 2 degrees, a third of a millimetre beside the axis
//  ----  ~|  |~~    a sheet of zero thickness beside the block with the hole
void insertAndRetract(const PegCase& one, const Effort& effort) {
  constexpr double kHoleTop = 0.009;
  constexpr double kSheetVoxel = 0.003;
  constexpr double kSheetX = -0.06;
  const auto hole = test::bakePart(one.hole, effort.fine,
                                   {test::boxAboutAxis(0.0, one.half, -0.0005, 0.0095)}, effort.spacing);
  const auto peg = test::bakePart(one.peg, effort.fine, {test::boxAboutAxis(0.0, one.half, -0.0005, 0.0105)},
                                  effort.spacing);
  ASSERT_TRUE(hole && peg);

  InsertionTrial insertion;
  test::IslandRig& rig = insertion.rig;
  const Pose start(Vector3(effort.sheet ? kSheetX : 0.0003, 0.0, 0.02), kTilted);
  const auto held = insertion.hold(*peg, start, {0.0, 0.0, 0.02});
  insertion.addStatic(held, *hole, one.clearance);
  if (effort.sheet) {
    rig.addStatic(held, test::sheetStructures(0.04, 0.0, kSheetVoxel, 0.0011),
                  Pose(Vector3(kSheetX, 0.0, 0.0)), test::kSolidVoxels * kSheetVoxel);
  }
  insertion.measureOverlap([&] { return test::overlapOfMeshes(*peg, *hole, rig.pose(held), kOverlap); });
  const auto go = [&](const Pose& X_WH, int ticks) {
    const Pose from = rig.body(held).springs[0].X_WG;
    for (int tick = 1; tick <= ticks; ++tick) {
      const Displacement path = displacement(from, X_WH);
      const double fraction = static_cast<double>(tick) / ticks;
      insertion.step(displaced(from, {fraction * path.translation, fraction * path.rotation}));
    }
  };

  if (effort.sheet) {
    // the hand goes through the sheet at 1 m/s, to 30 mm behind it
    go(Pose(Vector3(kSheetX, 0.0, -0.03), kTilted), 50);
    rig.settle(20);
    EXPECT_GT(rig.pose(held).translation().z(), 0.0011) << "through the sheet";
    EXPECT_GT(rig.force(2).force.z(), 20.0);
    go(start, 50);
  }
  // to the block, along it until the tip finds the hole, in, and out again
  insertion.largest_force = 0.0;
  go(Pose(Vector3(0.0003, -0.00015, 0.012), kTilted), 200);
  go(Pose(Vector3(0.0003, -0.00015, 0.0085), kTilted), 100);
  go(Pose(Vector3(0.0, 0.0, 0.0085), kTilted), 100);
  go(Pose(Vector3(0.0, 0.0, 0.0), kTilted), 400);
  rig.settle(10);
  EXPECT_NEAR(rig.pose(held).translation().z(), 0.0, 0.0005) << "not inserted";
  EXPECT_LE(tiltOf(rig.pose(held)), one.clearance / kHoleTop) << "the hole aligns it";
  go(Pose(Vector3(0.0003, 0.0, 0.02), kTilted), 500);
  EXPECT_NEAR(rig.pose(held).translation().z(), 0.02, 1e-6) << "not retracted";
  const Pose aside(Vector3(one.clearance, 0.0, 0.0));
  EXPECT_NEAR(test::overlapOfMeshes(*peg, *hole, aside, kOverlap), 0.5 * one.clearance, 0.1 * one.clearance)
      << "overlapOfMeshes finds no overlap where there is one";
  insertion.expectSmallForcesAndNoOverlap();
}

const PegCase kRound{"Round8", "nv_factory_round_8mm/factory_round_hole_8mm_subdiv_3x.obj",
                     "nv_factory_round_8mm/factory_round_peg_8mm_loose.obj", 0.000114, 0.0043};
const PegCase kRectangular{
    "Rectangular16", "nv_factory_rect_16mm/factory_rectangular_hole_16mm_subdiv_3x.obj",
    "nv_factory_rect_16mm/factory_rectangular_peg_16mm_loose_subdiv_3x.obj", 0.000248, 0.0085};

class RealPegs : public testing::TestWithParam<PegCase> {};
class RealPegsNightly : public testing::TestWithParam<PegCase> {};

// Hole and peg are thick solids: larger voxels than their clearance asks for take seconds.
TEST_P(RealPegs, TheHolePermitsTiltedInsertionAndRetraction) {
  insertAndRetract(GetParam(), {.fine = 0.0001, .spacing = 0.001, .sheet = false});
}

TEST_P(RealPegsNightly, TheSheetBlocksThePegAndTheHolePermitsTiltedInsertionAndRetraction) {
  insertAndRetract(GetParam(),
                   {.fine = test::voxelOf(GetParam().clearance), .spacing = 0.0005, .sheet = true});
}

INSTANTIATE_TEST_SUITE_P(Factory, RealPegs, testing::Values(kRound, kRectangular),
                         [](const auto& one) { return std::string(one.param.name); });
INSTANTIATE_TEST_SUITE_P(Factory, RealPegsNightly, testing::Values(kRound, kRectangular),
                         [](const auto& one) { return std::string(one.param.name); });

//   [nut]  <- the hand turns it and presses a little; the thread guides it down, 2 mm a turn
//    ~~
//   bolt
TEST(RealThreadNightly, ANutThatStartsTiltedIsScrewedOnAndOff) {
  const std::string folder = "nv_factory_nut_bolt_m16/";
  constexpr double kPitch = 0.002;
  constexpr double kClearance = 0.0002;  // [m] 0.1 mm at either flank of the thread
  constexpr double kTop = 0.025;         // [m] height of the nut where it leaves the bolt's tip
  constexpr int kTurnTicks = 628;
  constexpr int kTurns = 3;
  const Vector3 p_NC(0.0, 0.0, 0.0225);  // the nut's centre
  const double fine = test::voxelOf(kClearance);
  const auto bolt = test::bakePart(folder + "factory_bolt_m16_loose.ply", fine,
                                   {test::boxAboutAxis(0.0, 0.0085, 0.0355, 0.0415)}, 0.0005);
  const auto nut = test::bakePart(folder + "factory_nut_m16_loose_subdiv_3x.ply", fine,
                                  {test::boxAboutAxis(0.0, 0.0085, 0.0155, 0.0215)}, 0.0005);
  ASSERT_TRUE(bolt && nut);

  InsertionTrial insertion;
  test::IslandRig& rig = insertion.rig;
  // raised, turned about the bolt's axis, then tilted about its centre
  const auto placed = [&p_NC](double lift, double turn, double tilt) {
    const Quaternion q = expRotation({tilt, 0.0, 0.0}) * expRotation({0.0, 0.0, turn});
    return Pose(Vector3(0.0002, -0.0001, lift) + p_NC - q * p_NC, q);
  };
  const auto held = insertion.hold(*nut, placed(0.0265, 0.0, kLean), p_NC);
  insertion.addStatic(held, *bolt, kClearance);
  insertion.measureOverlap([&] { return test::overlapOfMeshes(*nut, *bolt, rig.pose(held), kOverlap); });
  const auto lift = [&] { return (rig.pose(held) * p_NC - p_NC).z(); };
  const auto step = [&insertion](const Pose& X_WH) { insertion.step(X_WH); };

  constexpr double kPress = 0.002;  // [m] the hand ahead of the thread: 2 N
  for (int tick = 1; tick <= 150; ++tick) step(placed(0.0265 - 0.0035 * tick / 150.0, 0.0, kLean));
  for (int tick = 1; tick <= kTurns * kTurnTicks; ++tick) {
    const double turns = static_cast<double>(tick) / kTurnTicks;
    step(placed(kTop - kPress - kPitch * turns, -kTurn * turns, kLean * std::max(1.0 - turns, 0.0)));
    if (turns < kTurns - 1) continue;
    // at the pose of the files, with no turn, the threads are a whole number of pitches apart
    const double off_thread = std::remainder(lift() + kPitch * turns, kPitch);
    ASSERT_LE(std::abs(off_thread), 0.5 * kClearance) << "the nut left the thread after turns: " << turns;
    ASSERT_LE(tiltOf(rig.pose(held)), 0.01);
  }
  EXPECT_LE(lift(), kTop - kPitch * (kTurns - 1)) << "not mounted";
  constexpr double kOff = kTurns + 0.5;
  const double deep = lift();
  for (int tick = 1; tick <= static_cast<int>(kOff * kTurnTicks); ++tick) {
    const double turns = static_cast<double>(tick) / kTurnTicks;
    step(placed(deep + kPitch * turns + 0.5 * kPress, kTurn * (turns - kTurns), 0.0));
  }
  for (int tick = 1; tick <= 100; ++tick) {
    step(placed(deep + kPitch * kOff + 0.5 * kPress + 0.004 * tick / 100.0, 0.5 * kTurn, 0.0));
  }
  EXPECT_EQ(insertion.force(), 0.0) << "not taken off";
  insertion.expectSmallForcesAndNoOverlap();
}

}  // namespace
}  // namespace tenon::collision
