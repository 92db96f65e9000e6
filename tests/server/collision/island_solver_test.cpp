#include "server/collision/island_solver.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"
#include "tests/support/realtime_guard.h"

namespace tenon::collision {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::floorStructures;
using test::IslandRig;
using test::sheetStructures;
using test::socketStructures;
using test::sphereStructures;
using test::StructuresPtr;

constexpr double kHandStiffness = 1000.0;

//      device            A floor at z = 0 pushes up (+z). The hand dives below it
//        |  motion       while moving along +x: the proxy slides, it does not sink.
//   S o--+-> x
//   ~~~~~|~~~~~ floor
TEST(IslandSolver, SlidesAlongAFloorInsteadOfSinking) {
  test::IslandRig rig;
  const auto box =
      rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(-0.05, 0.0, 0.02)));
  rig.addStatic(box, test::floorStructures(0.4, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(-0.05, 0.0, -0.04)), 100);
  for (int tick = 1; tick <= 200; ++tick) {
    rig.setHand(box, Pose(Vector3(-0.05 + 0.0005 * tick, 0.0, -0.04)));  // 0.5 m/s
    rig.step();
    const Vector3 p = rig.pose(box).translation();
    ASSERT_NEAR(p.x(), -0.05 + 0.0005 * tick, 1e-5) << "lag";
    ASSERT_NEAR(p.z(), 0.0105, 1e-5);
    ASSERT_NEAR(rig.force(0).force.z(), kHandStiffness * (p.z() + 0.04), 1e-3 * 50.0);
    ASSERT_LE(rig.force(0).force.head<2>().norm(), 1e-3 * rig.force(0).force.z());
  }
}

TEST(IslandSolver, ForceIsStiffnessTimesTheDistanceBetweenHandAndBody) {
  test::IslandRig rig;
  const auto ball = rig.addBody(test::sphereStructures(0.02, 0.001, 0.002), Pose(Vector3(0.0, 0.0, 0.025)));
  rig.addStatic(ball, test::floorStructures(0.2, 0.002), Pose(), 0.0005);
  for (const double depth : {0.001, 0.005, 0.02}) {
    rig.moveHand(ball, Pose(Vector3(0.0, 0.0, 0.0205 - depth)), 100);
    rig.settle(50);
    const double stretch = rig.pose(ball).translation().z() - (0.0205 - depth);
    EXPECT_NEAR(stretch, depth, 1e-4) << "the ball's points are 2 mm apart";
    EXPECT_NEAR(rig.force(0).force.z(), kHandStiffness * stretch, 0.01);
    EXPECT_NEAR(springWrench(rig.body(ball).springs[0], rig.pose(ball)).force.z(), -kHandStiffness * stretch,
                1e-6);
  }
}

// one end of a bar rests on a support, the hand at its middle presses it down: torque is arm times force
TEST(IslandSolver, TorqueIsAboutTheBodysOrigin) {
  test::IslandRig rig;
  const auto bar =
      rig.addBody(test::boxStructures({0.2, 0.02, 0.02}, 0.002, 0.005), Pose(Vector3(0.0, 0.0, 0.02)), 1e4);
  rig.addStatic(bar, test::boxStructures({0.02, 0.02, 0.02}, 0.001, 0.005), Pose(Vector3(0.08, 0.0, -0.01)),
                0.0005);
  rig.moveHand(bar, Pose(Vector3(0.0, 0.0, 0.0)), 100);
  rig.settle(100);
  const Wrench F_Ao_W = rig.force(0);
  EXPECT_GT(F_Ao_W.force.z(), 1.0);
  const Vector3 arm = F_Ao_W.force.cross(F_Ao_W.torque) / F_Ao_W.force.squaredNorm();
  EXPECT_NEAR(arm.x(), 0.07, 0.021);  // over the support
  const Wrench coupling = springWrench(rig.body(bar).springs[0], rig.pose(bar));
  EXPECT_LE((coupling.force + F_Ao_W.force).norm(), 1e-3 * F_Ao_W.force.norm());
  EXPECT_LE((coupling.torque + F_Ao_W.torque).norm(), 1e-3 * F_Ao_W.force.norm());
}

struct SheetCase {
  const char* name;
  double thickness;  ///< [m]
  double offset;     ///< [m] of the sheet's middle from a layer of samples
  double speed;      ///< [m/s]
};
void PrintTo(const SheetCase& sheet, std::ostream* out) { *out << sheet.name; }

class Sheets : public testing::TestWithParam<SheetCase> {};

//   |  the hand goes 50 mm behind the sheet, at 1 m/s and 3 m/s
//   v
//  -----  1 mm or zero thick, at several offsets from the layers of samples
TEST_P(Sheets, AreNeverPassedByAHeldBox) {
  const SheetCase sheet = GetParam();
  test::IslandRig rig;
  const Pose start(Vector3(0.003, 0.002, 0.05), expRotation({0.17, 0.05, 0.0}));
  const auto box = rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.003), start);
  const double dilation = 0.003;
  rig.addStatic(box, test::sheetStructures(0.3, sheet.thickness, 0.003, sheet.offset), Pose(), dilation);
  const double surface = sheet.offset + 0.5 * sheet.thickness + dilation;
  double worst = 1.0;
  for (int tick = 0; tick < 300; ++tick) {
    const double z = std::max(0.05 - sheet.speed * 1e-3 * tick, -0.05);
    rig.setHand(box, Pose(Vector3(0.003, 0.002, z), start.rotation()));
    rig.step();
    for (const structures::ShellPoint& point : rig.shell(box).points()) {
      worst = std::min(worst, (rig.pose(box) * point.p_MP.cast<double>()).z() - surface);
    }
  }
  // a sheet of zero thickness between two layers of samples is thicker in the field, never thinner
  EXPECT_GE(worst, -5e-5);
  EXPECT_LE(worst, 0.003);
  EXPECT_GT(rig.force(0).force.z(), 20.0);
}

INSTANTIATE_TEST_SUITE_P(IslandSolver, Sheets,
                         testing::Values(SheetCase{"OneMillimetre", 0.001, 0.0, 1.0},
                                         SheetCase{"OneMillimetreOffGrid", 0.001, 0.0011, 1.0},
                                         SheetCase{"OneMillimetreOffGridFast", 0.001, 0.0019, 3.0},
                                         SheetCase{"ZeroThickness", 0.0, 0.0, 1.0},
                                         SheetCase{"ZeroThicknessOffGrid", 0.0, 0.0013, 1.0},
                                         SheetCase{"ZeroThicknessFast", 0.0, 0.0007, 3.0}),
                         [](const auto& sheet) { return sheet.param.name; });

//      o            a slope of 45 degrees: the hand moves behind it, the box slides on it and is always at
//     / \           the point of the slope nearest to the hand
TEST(IslandSolver, SlidesOnASlopeWithoutLag) {
  const Quaternion turn = expRotation({0.0, 0.7853981633974483, 0.0});
  const Vector3 n = turn * Vector3::UnitZ();
  const Vector3 along = turn * Vector3::UnitX();
  test::IslandRig rig;
  const auto box = rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(0.02 * n, turn));
  rig.addStatic(box, test::floorStructures(0.4, 0.002), Pose(Vector3::Zero(), turn), 0.0005);
  rig.moveHand(box, Pose(-0.01 * n, turn), 50);
  for (int tick = 1; tick <= 200; ++tick) {
    const Vector3 hand = -0.01 * n + 0.0005 * tick * (0.8 * along + Vector3(0.0, 0.2, 0.0));
    rig.setHand(box, Pose(hand, turn));
    rig.step();
    const Vector3 lag = rig.pose(box).translation() - hand;
    ASSERT_LE((lag - lag.dot(n) * n).norm(), 1e-5);
    ASSERT_NEAR(rig.pose(box).translation().dot(n), 0.0105, 1e-5);
  }
}

TEST(IslandSolver, SlidesAlongAnInnerCornerWithoutLag) {
  test::IslandRig rig;
  const auto box =
      rig.addBody(test::boxStructures({0.03, 0.03, 0.03}, 0.002, 0.004), Pose(Vector3(0.03, 0.03, 0.08)));
  rig.addStatic(box, test::cornerStructures(0.2, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(-0.01, -0.01, 0.08)), 100);
  for (int tick = 1; tick <= 100; ++tick) {
    const double z = 0.08 + 0.0005 * tick;
    rig.setHand(box, Pose(Vector3(-0.01, -0.01, z)));
    rig.step();
    const Vector3 p = rig.pose(box).translation();
    ASSERT_NEAR(p.z(), z, 1e-5);
    // the interpolated field rounds an inner corner by less than a voxel, nearly the same everywhere
    ASSERT_NEAR(p.x(), 0.016, 5e-5);
    ASSERT_NEAR(p.y(), p.x(), 1e-5);
  }
}

TEST(IslandSolver, NeverPullsBackARetreatingHand) {
  test::IslandRig rig;
  const auto box =
      rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, test::floorStructures(0.3, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, -0.01)), 60);
  for (int tick = 0; tick < 60; ++tick) {
    const double z = -0.01 + 0.0005 * tick;
    rig.setHand(box, Pose(Vector3(0.0, 0.0, z)));
    rig.step();
    EXPECT_GE(rig.force(0).force.z(), 0.0);
    if (z > 0.0106) {
      EXPECT_EQ(rig.force(0).force.z(), 0.0) << "contact ends within the tick";
      EXPECT_NEAR(rig.pose(box).translation().z(), z, 1e-9);
    }
  }
}

//    o    the hand presses a ball on a floor and turns it
//  ~~~~~
TEST(IslandSolver, ABodyInPointContactFollowsTheHandsRotation) {
  test::IslandRig rig;
  const auto ball = rig.addBody(test::sphereStructures(0.02, 0.001, 0.002), Pose(Vector3(0.0, 0.0, 0.025)));
  rig.addStatic(ball, test::floorStructures(0.2, 0.002), Pose(), 0.0005);
  rig.moveHand(ball, Pose(Vector3(0.0, 0.0, 0.018)), 30);
  const Vector3 turn(0.3, -0.2, 0.5);
  for (int tick = 1; tick <= 300; ++tick) {
    rig.setHand(ball, Pose(Vector3(0.0, 0.0, 0.018), expRotation(turn * (tick / 300.0))));
    rig.step();
  }
  rig.settle(30);
  EXPECT_LE((logRotation(rig.pose(ball).rotation()) - turn).norm(), 0.02);
}

TEST(IslandSolver, AHandAtRestMeansABodyAtRest) {
  struct Scene {
    test::StructuresPtr structures;
    Pose start, hand;
  };
  const test::StructuresPtr box = test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.003);
  const test::StructuresPtr ball = test::sphereStructures(0.02, 0.001, 0.002);
  const Vector3 above(0.05, 0.05, 0.05);
  const std::vector<Scene> scenes{
      {box, Pose(above), Pose(Vector3(0.005, 0.01, -0.01), expRotation({0.3, 0.2, 0.1}))},
      {box, Pose(above), Pose(Vector3(0.05, 0.05, 0.0), expRotation({0.0, 0.0, 0.4}))},
      {box, Pose(above, expRotation({0.5, 0.6, 0.2})),
       Pose(Vector3(-0.02, -0.02, 0.0), expRotation({0.5, 0.6, 0.2}))},
      // tilted, the goal far behind a corner that the field rounds
      {box, Pose(above), Pose(Vector3(-0.02, -0.022, -0.02), expRotation({0.01, 0.02, 0.0}))},
      {box, Pose(above), Pose(Vector3(-0.01, -0.012, -0.02))},
      {ball, Pose(above), Pose(Vector3(0.0, 0.0, 0.0))},
      {ball, Pose(above), Pose(Vector3(0.01, 0.03, 0.01), expRotation({0.1, 0.0, 0.3}))}};
  const test::StructuresPtr corner = test::cornerStructures(0.15, 0.003);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    test::IslandRig rig;
    const auto body = rig.addBody(scenes[i].structures, scenes[i].start);
    rig.addStatic(body, corner, Pose(), 0.0027);
    rig.moveHand(body, scenes[i].hand, 100);
    rig.settle(100);
    double jitter = 0.0;
    for (int tick = 0; tick < 200; ++tick) {
      const Pose before = rig.pose(body);
      rig.step();
      const Displacement moved = displacement(before, rig.pose(body));
      jitter = std::max(jitter, moved.translation.norm() + moved.rotation.norm() * rig.body(body).radius);
    }
    EXPECT_LT(jitter, 1e-6) << "scene " << i;
  }
}

//   |  | peg 19.5 mm wide, tilted by 2 degrees
//  ~|  |~~
//   |__|    hole 20 mm wide, 20 mm deep; dilation 0.1 mm, so voxels of 0.115 mm
TEST(IslandSolver, APegWithHalfAMillimetreClearanceIsInsertedAndRetracted) {
  test::IslandRig rig;
  const Quaternion tilted = expRotation({0.035, 0.0, 0.0});
  const auto peg = rig.addBody(test::boxStructures({0.0195, 0.0195, 0.03}, 0.001, 0.0025),
                               Pose(Vector3(0.0002, -0.0001, 0.02), tilted));
  // pairs in both directions: alone, the peg's points, 2.5 mm apart, would catch on the rim one after another
  const test::StructuresPtr socket = test::socketStructures({0.02, 0.02, 0.02}, 0.003, 0.000115, 0.001);
  rig.addStatic(peg, socket, Pose(), 0.0001);
  rig.addStaticShell(peg, socket, Pose(), 0.0001);
  // aligned while the tip finds the hole, tilted again while it is pushed in
  rig.moveHand(peg, Pose(Vector3(0.0002, -0.0001, 0.014), expRotation({0.01, 0.005, 0.0})), 100);
  rig.moveHand(peg, Pose(Vector3(0.0, 0.0, -0.0035), tilted), 500);
  EXPECT_LT(rig.pose(peg).translation().z(), -0.0025);
  EXPECT_GT(rig.pose(peg).translation().z(), -0.005);
  EXPECT_LT(logRotation(rig.pose(peg).rotation()).norm(), 0.02) << "the hole aligns it";
  EXPECT_GT(rig.smallest_gap, -5e-5);

  double jitter = 0.0;
  rig.settle(50);
  for (int tick = 0; tick < 100; ++tick) {
    const Pose before = rig.pose(peg);
    rig.step();
    const Displacement moved = displacement(before, rig.pose(peg));
    jitter = std::max(jitter, moved.translation.norm() + moved.rotation.norm() * rig.body(peg).radius);
  }
  EXPECT_LT(jitter, 1e-6);

  rig.moveHand(peg, Pose(Vector3(0.0, 0.0, 0.04), expRotation({-0.02, 0.02, 0.0})), 500);
  EXPECT_NEAR(rig.pose(peg).translation().z(), 0.04, 1e-6);
  EXPECT_GT(rig.smallest_gap, -5e-5);
}

//   hand a ->  [cube] [part]  <- hand b
TEST(IslandSolver, BothHandsFeelOppositeForcesWhenTheirPartsTouch) {
  test::IslandRig rig;
  const test::StructuresPtr cube = test::boxStructures({0.03, 0.03, 0.03}, 0.002, 0.004);
  const test::StructuresPtr part = test::boxStructures({0.06, 0.05, 0.05}, 0.002, 0.004);
  const auto a = rig.addBody(cube, Pose(Vector3(-0.06, 0.004, 0.0)));
  const auto b = rig.addBody(part, Pose(Vector3(0.0, 0.0, 0.0)), 2000.0);
  rig.addPair(a, b, 0.0005);
  rig.moveHand(a, Pose(Vector3(-0.03, 0.004, 0.0)), 100);
  rig.settle(50);
  const Wrench on_a = springWrench(rig.body(a).springs[0], rig.pose(a));
  const Wrench on_b = springWrench(rig.body(b).springs[0], rig.pose(b));
  EXPECT_GT(on_a.force.x(), 5.0);
  EXPECT_LE((on_a.force + on_b.force).norm(), 1e-3 * on_a.force.norm());
  EXPECT_LE((rig.force(0).force + on_a.force).norm(), 1e-3 * on_a.force.norm());
  // moments about one point cancel too
  const Vector3 moment_a = on_a.torque + rig.pose(a).translation().cross(on_a.force);
  const Vector3 moment_b = on_b.torque + rig.pose(b).translation().cross(on_b.force);
  EXPECT_LE((moment_a + moment_b).norm(), 1e-3 * on_a.force.norm());
  EXPECT_GT(rig.pose(b).translation().x(), 0.001) << "the part yields";
}

TEST(IslandSolver, ForceIsEquivariantUnderAChangeOfWorldFrame) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004);
  const test::StructuresPtr corner = test::cornerStructures(0.12, 0.003);
  const Pose X_VW(Vector3(0.3, -0.2, 0.5), expRotation({0.4, -1.0, 0.7}));
  const auto run = [&](const Pose& X_VN) {
    test::IslandRig rig;
    const auto body = rig.addBody(box, X_VN * Pose(Vector3(0.04, 0.04, 0.04)));
    rig.addStatic(body, corner, X_VN, 0.0027);
    for (int tick = 0; tick < 100; ++tick) {
      const double s = 0.0005 * tick;
      rig.setHand(body, X_VN * Pose(Vector3(0.04 - s, 0.04 - s, 0.04 - s), expRotation({0.1 * s, 0.0, s})));
      rig.step();
    }
    return rig.force(0);
  };
  const Wrench here = run(Pose());
  const Wrench there = run(X_VW);
  EXPECT_GT(here.force.norm(), 10.0);
  EXPECT_LE((there.force - X_VW.rotation() * here.force).norm(), 1e-5 * here.force.norm());
}

TEST(IslandSolver, IsDeterministicToTheLastBit) {
  const auto run = [] {
    test::IslandRig rig;
    const auto body =
        rig.addBody(test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004), Pose(Vector3(0.04, 0.04, 0.04)));
    rig.addStatic(body, test::cornerStructures(0.12, 0.003), Pose(), 0.0027);
    rig.moveHand(body, Pose(Vector3(-0.01, 0.0, -0.02), expRotation({0.4, 0.2, 0.1})), 150);
    return rig.pose(body);
  };
  EXPECT_TRUE(run() == run());
}

//   ---->     in free air to the goal in one solve; pressed on a floor, 1 mm in each
//   [_]-->
//  ========
TEST(IslandSolver, ReportsUnconvergedWhenStepsRunOutAndContinuesInTheNextTick) {
  test::IslandRig rig;
  const auto box = rig.addBody(test::boxStructures({0.02, 0.02, 0.02}, 0.002, 0.004), Pose());
  rig.limits.max_steps = 4;
  rig.limits.max_step_length = 0.00025;
  rig.setHand(box, Pose(Vector3(0.0035, 0.0, 0.0)));
  EXPECT_FALSE(rig.step().unconverged);
  EXPECT_TRUE(rig.pose(box) == Pose(Vector3(0.0035, 0.0, 0.0)))
      << "without contact the goal is reached exactly";

  rig.addStatic(box, test::boxStructures({0.1, 0.1, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, -0.02)),
                0.0);
  rig.setHand(box, Pose(Vector3(0.0, 0.0, -0.001)));
  for (const double x : {0.0025, 0.0015, 0.0005}) {
    EXPECT_TRUE(rig.step().unconverged);
    EXPECT_NEAR(rig.pose(box).translation().x(), x, 2e-5);
  }
  EXPECT_FALSE(rig.step().unconverged);
  EXPECT_NEAR(rig.pose(box).translation().x(), 0.0, 1e-5);
}

//   the hand is 2 mm ahead, inside the ground; one step of 0.25 mm takes the whole work limit
TEST(IslandSolver, WhatExceedsTheWorkLimitIsLeftToTheNextTick) {
  test::IslandRig free, limited;
  for (test::IslandRig* rig : {&free, &limited}) {
    const auto box =
        rig->addBody(test::boxStructures({0.02, 0.02, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.0003)));
    rig->addStatic(box, test::boxStructures({0.1, 0.1, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, -0.02)),
                   0.0);
    rig->limits.max_step_length = 0.00025;
    rig->setHand(box, Pose(Vector3(0.002, 0.0, -0.001)));
  }
  limited.limits.work = 1;
  const SolveReport at_once = free.step();
  EXPECT_FALSE(at_once.work_limited);
  EXPECT_GT(at_once.work, 0U);
  int limited_ticks = 0;
  double before = 0.0;
  for (int tick = 0; tick < 30; ++tick) {
    const SolveReport report = limited.step();
    limited_ticks += report.work_limited ? 1 : 0;
    if (!report.work_limited) continue;
    EXPECT_TRUE(report.unconverged);
    EXPECT_LT(report.steps, at_once.steps);
    const double x = limited.pose(0).translation().x();
    EXPECT_GT(x, before) << "it moves in each tick";
    EXPECT_LE(x, before + 2.0 * limited.limits.max_step_length) << "one step, or two";
    EXPECT_GT(limited.smallest_gap, -5e-6) << "and never into the ground";
    before = x;
  }
  EXPECT_GE(limited_ticks, 4);
  free.settle(30);
  EXPECT_FALSE(limited.step().work_limited) << "at the goal";
  EXPECT_NEAR(limited.pose(0).translation().x(), free.pose(0).translation().x(), 5e-6);
  EXPECT_NEAR(limited.pose(0).translation().z(), free.pose(0).translation().z(), 5e-6);
}

//   a sheet 0.5 mm thin: a hand at 3 m/s goes through, its body does not, with the least work there is
TEST(IslandSolver, TheWorkLimitLetsNothingThroughASheet) {
  test::IslandRig rig;
  const auto box =
      rig.addBody(test::boxStructures({0.02, 0.02, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, test::boxStructures({0.1, 0.1, 0.0005}, 0.002, 0.004), Pose(), 0.001);
  rig.limits.work = 1;
  for (int tick = 1; tick <= 40; ++tick) {
    rig.setHand(box, Pose(Vector3(0.0, 0.0, 0.02 - 0.003 * tick), expRotation({0.0, 0.01 * tick, 0.0})));
    rig.step();
    ASSERT_GT(rig.pose(box).translation().z(), 0.0);
  }
  EXPECT_GT(rig.smallest_gap, -1e-4);
}

TEST(IslandSolver, AllocatesNothing) {
  test::IslandRig rig;
  const auto box =
      rig.addBody(test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.002), Pose(Vector3(0.04, 0.04, 0.04)));
  rig.addStatic(box, test::cornerStructures(0.12, 0.003), Pose(), 0.0027);
  rig.step();
  for (const ContactMethod method :
       {ContactMethod::kIsland, ContactMethod::kBlocking, ContactMethod::kPenalty}) {
    rig.limits.method = method;
    rig.setHand(box, Pose(Vector3(0.01, 0.01, 0.0)));
    const test::RealtimeGuard guard;
    for (int tick = 0; tick < 100; ++tick) rig.step();
    EXPECT_EQ(guard.allocations(), 0);
    EXPECT_EQ(guard.locks(), 0);
  }
}

TEST(Baselines, PenaltyLetsABodyFollowItsHandIntoTheFloor) {
  test::IslandRig rig;
  rig.limits.method = ContactMethod::kPenalty;
  const auto box =
      rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, test::floorStructures(0.3, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, 0.009)), 50);
  EXPECT_NEAR(rig.pose(box).translation().z(), 0.009, 1e-9);
  // overlap of 1.5 mm with the dilated floor
  EXPECT_GT(rig.force(0).force.z(), 1000.0 * 0.0014 * 12.0);
  EXPECT_NEAR(rig.results[0].query.deepest, 0.0015, 2e-6);
}

TEST(Baselines, BlockingStopsAtAFloorAndSlides) {
  test::IslandRig rig;
  rig.limits.method = ContactMethod::kBlocking;
  const auto box =
      rig.addBody(test::boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, test::floorStructures(0.4, 0.002), Pose(), 0.0015);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, -0.02)), 100);
  rig.moveHand(box, Pose(Vector3(0.05, 0.0, -0.02)), 100);
  EXPECT_NEAR(rig.pose(box).translation().x(), 0.05, 1e-3);
  EXPECT_GT(rig.pose(box).translation().z(), 0.01);  // above the real floor
}

}  // namespace
}  // namespace tenon::collision
