#include "server/collision/island_solver.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/collision/island_rig.h"
#include "tests/support/realtime_guard.h"

namespace tenon {
namespace {

using test::boxStructures;
using test::cornerStructures;
using test::floorStructures;
using test::IslandRig;
using test::sheetStructures;
using test::socketStructures;
using test::sphereStructures;
using test::StructuresPtr;

constexpr double kStiffness = 1000.0;

//      device            A floor at z = 0 pushes up (+z). The hand dives below it
//        |  motion       while moving along +x: the proxy slides, it does not sink.
//   S o--+-> x
//   ~~~~~|~~~~~ floor
TEST(IslandSolver, SlidesAlongAFloorInsteadOfSinking) {
  IslandRig rig;
  const auto box =
      rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(-0.05, 0.0, 0.02)));
  rig.addStatic(box, floorStructures(0.4, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(-0.05, 0.0, -0.04)), 100);
  for (int tick = 1; tick <= 200; ++tick) {
    rig.setHand(box, Pose(Vector3(-0.05 + 0.0005 * tick, 0.0, -0.04)));  // 0.5 m/s
    rig.step();
    const Vector3 p = rig.pose(box).translation();
    ASSERT_NEAR(p.x(), -0.05 + 0.0005 * tick, 1e-5) << "lag";
    ASSERT_NEAR(p.z(), 0.0105, 1e-5);
    ASSERT_NEAR(rig.force(0).force.z(), kStiffness * (p.z() + 0.04), 1e-3 * 50.0);
    ASSERT_LE(rig.force(0).force.head<2>().norm(), 1e-3 * rig.force(0).force.z());
  }
}

TEST(IslandSolver, ForceIsStiffnessTimesTheWayBetweenHandAndBody) {
  IslandRig rig;
  const auto ball = rig.addBody(sphereStructures(0.02, 0.001, 0.002), Pose(Vector3(0.0, 0.0, 0.025)));
  rig.addStatic(ball, floorStructures(0.2, 0.002), Pose(), 0.0005);
  for (const double depth : {0.001, 0.005, 0.02}) {
    rig.moveHand(ball, Pose(Vector3(0.0, 0.0, 0.0205 - depth)), 100);
    rig.settle(50);
    const double gone = rig.pose(ball).translation().z() - (0.0205 - depth);
    EXPECT_NEAR(gone, depth, 1e-4) << "the ball's points are 2 mm apart";
    EXPECT_NEAR(rig.force(0).force.z(), kStiffness * gone, 0.01);
    EXPECT_NEAR(springWrench(rig.body(ball).springs[0], rig.pose(ball)).force.z(), -kStiffness * gone, 1e-6);
  }
}

// an edge 10 mm under the dilated rim, the hand behind it: the torque is the force on its arm
TEST(IslandSolver, TorqueIsAboutTheBodysOrigin) {
  IslandRig rig;
  const auto bar =
      rig.addBody(boxStructures({0.2, 0.02, 0.02}, 0.002, 0.005), Pose(Vector3(0.0, 0.0, 0.02)), 1e4);
  rig.addStatic(bar, boxStructures({0.02, 0.02, 0.02}, 0.001, 0.005), Pose(Vector3(0.08, 0.0, -0.01)),
                0.0005);
  rig.moveHand(bar, Pose(Vector3(0.0, 0.0, 0.0)), 100);
  rig.settle(100);
  const Wrench F_Ao_W = rig.force(0);
  EXPECT_GT(F_Ao_W.force.z(), 1.0);
  const Vector3 arm = F_Ao_W.force.cross(F_Ao_W.torque) / F_Ao_W.force.squaredNorm();
  EXPECT_NEAR(arm.x(), 0.07, 0.021);  // somewhere under the support
  const Wrench coupling = springWrench(rig.body(bar).springs[0], rig.pose(bar));
  EXPECT_LE((coupling.force + F_Ao_W.force).norm(), 1e-3 * F_Ao_W.force.norm());
  EXPECT_LE((coupling.torque + F_Ao_W.torque).norm(), 1e-3 * F_Ao_W.force.norm());
}

struct SheetCase {
  const char* name;
  double thickness;
  double offset;
  double speed;
};

class Sheets : public testing::TestWithParam<SheetCase> {};

//   |  1 m/s and 3 m/s, on to 50 mm behind
//   v
//  -----  1 mm or nothing thick, anywhere between two voxels
TEST_P(Sheets, NeverLetAHeldBoxThrough) {
  const SheetCase sheet = GetParam();
  IslandRig rig;
  const Pose start(Vector3(0.003, 0.002, 0.05), expRotation({0.17, 0.05, 0.0}));
  const auto box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.003), start);
  const double dilation = 0.003;
  rig.addStatic(box, sheetStructures(0.3, sheet.thickness, 0.003, sheet.offset), Pose(), dilation);
  const double surface = sheet.offset + 0.5 * sheet.thickness + dilation;
  double worst = 1.0;
  for (int tick = 0; tick < 300; ++tick) {
    const double z = std::max(0.05 - sheet.speed * 1e-3 * tick, -0.05);
    rig.setHand(box, Pose(Vector3(0.003, 0.002, z), start.rotation()));
    rig.step();
    for (const ShellPoint& point : rig.shell(box).points()) {
      worst = std::min(worst, (rig.pose(box) * point.p_MP.cast<double>()).z() - surface);
    }
  }
  // a zero-thickness sheet between two voxels is thicker in the field than in truth, never thinner
  EXPECT_GE(worst, -5e-5);
  EXPECT_LE(worst, 0.003);
  EXPECT_GT(rig.force(0).force.z(), 20.0);
}

INSTANTIATE_TEST_SUITE_P(IslandSolver, Sheets,
                         testing::Values(SheetCase{"OneMillimetre", 0.001, 0.0, 1.0},
                                         SheetCase{"OneMillimetreOffGrid", 0.001, 0.0011, 1.0},
                                         SheetCase{"OneMillimetreOffGridFast", 0.001, 0.0019, 3.0},
                                         SheetCase{"Nothing", 0.0, 0.0, 1.0},
                                         SheetCase{"NothingOffGrid", 0.0, 0.0013, 1.0},
                                         SheetCase{"NothingFast", 0.0, 0.0007, 3.0}),
                         [](const auto& sheet) { return sheet.param.name; });

//      o            a wall at 45 degrees: the hand goes straight on into it,
//     / \           the ball goes along it and is always at the foot of the hand
TEST(IslandSolver, SlidesOnASlopeWithoutLag) {
  const Quaternion turn = expRotation({0.0, 0.7853981633974483, 0.0});
  const Vector3 n = turn * Vector3::UnitZ();
  const Vector3 along = turn * Vector3::UnitX();
  IslandRig rig;
  const auto box = rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(0.02 * n, turn));
  rig.addStatic(box, floorStructures(0.4, 0.002), Pose(Vector3::Zero(), turn), 0.0005);
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
  IslandRig rig;
  const auto box =
      rig.addBody(boxStructures({0.03, 0.03, 0.03}, 0.002, 0.004), Pose(Vector3(0.03, 0.03, 0.08)));
  rig.addStatic(box, cornerStructures(0.2, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(-0.01, -0.01, 0.08)), 100);
  for (int tick = 1; tick <= 100; ++tick) {
    const double z = 0.08 + 0.0005 * tick;
    rig.setHand(box, Pose(Vector3(-0.01, -0.01, z)));
    rig.step();
    const Vector3 p = rig.pose(box).translation();
    ASSERT_NEAR(p.z(), z, 1e-5);
    // the interpolated field rounds an inner corner: by less than a voxel, nearly the same all along
    ASSERT_NEAR(p.x(), 0.016, 5e-5);
    ASSERT_NEAR(p.y(), p.x(), 1e-5);
  }
}

TEST(IslandSolver, NeverPullsBackARetreatingHand) {
  IslandRig rig;
  const auto box =
      rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, floorStructures(0.3, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, -0.01)), 60);
  for (int tick = 0; tick < 60; ++tick) {
    const double z = -0.01 + 0.0005 * tick;
    rig.setHand(box, Pose(Vector3(0.0, 0.0, z)));
    rig.step();
    EXPECT_GE(rig.force(0).force.z(), 0.0);
    if (z > 0.0106) {
      EXPECT_EQ(rig.force(0).force.z(), 0.0) << "let go within the tick";
      EXPECT_NEAR(rig.pose(box).translation().z(), z, 1e-9);
    }
  }
}

//          hand turns a bar about the tip that rests on the floor: it turns
//        o----
TEST(IslandSolver, ABodyThatRestsOnOnePointMayTurnAboutIt) {
  IslandRig rig;
  const auto ball = rig.addBody(sphereStructures(0.02, 0.001, 0.002), Pose(Vector3(0.0, 0.0, 0.025)));
  rig.addStatic(ball, floorStructures(0.2, 0.002), Pose(), 0.0005);
  rig.moveHand(ball, Pose(Vector3(0.0, 0.0, 0.018)), 30);
  const Vector3 turn(0.3, -0.2, 0.5);
  for (int tick = 1; tick <= 300; ++tick) {
    rig.setHand(ball, Pose(Vector3(0.0, 0.0, 0.018), expRotation(turn * (tick / 300.0))));
    rig.step();
  }
  rig.settle(30);
  EXPECT_LE((logRotation(rig.pose(ball).rotation()) - turn).norm(), 0.02);
}

TEST(IslandSolver, AStillHandMeansAStillBody) {
  struct Scene {
    StructuresPtr structures;
    Pose start, hand;
  };
  const StructuresPtr box = boxStructures({0.04, 0.03, 0.02}, 0.002, 0.003);
  const StructuresPtr ball = sphereStructures(0.02, 0.001, 0.002);
  const Vector3 above(0.05, 0.05, 0.05);
  const std::vector<Scene> scenes{
      {box, Pose(above), Pose(Vector3(0.005, 0.01, -0.01), expRotation({0.3, 0.2, 0.1}))},
      {box, Pose(above), Pose(Vector3(0.05, 0.05, 0.0), expRotation({0.0, 0.0, 0.4}))},
      {box, Pose(above, expRotation({0.5, 0.6, 0.2})),
       Pose(Vector3(-0.02, -0.02, 0.0), expRotation({0.5, 0.6, 0.2}))},
      // far beyond a vertex, askew: corners that the field rounds, and a goal far behind them
      {box, Pose(above), Pose(Vector3(-0.02, -0.022, -0.02), expRotation({0.01, 0.02, 0.0}))},
      {box, Pose(above), Pose(Vector3(-0.01, -0.012, -0.02))},
      {ball, Pose(above), Pose(Vector3(0.0, 0.0, 0.0))},
      {ball, Pose(above), Pose(Vector3(0.01, 0.03, 0.01), expRotation({0.1, 0.0, 0.3}))}};
  const StructuresPtr corner = cornerStructures(0.15, 0.003);
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    IslandRig rig;
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

//   |  | peg 19.5 mm, 2 degrees askew
//  ~|  |~~
//   |__|    hole 20 mm wide, 20 mm deep; dilation 0.1 mm, so voxels of 0.115 mm
TEST(IslandSolver, APegOfHalfAMillimetreClearanceGoesInAndComesOut) {
  IslandRig rig;
  const Quaternion askew = expRotation({0.035, 0.0, 0.0});
  const auto peg = rig.addBody(boxStructures({0.0195, 0.0195, 0.03}, 0.001, 0.0025),
                               Pose(Vector3(0.0002, -0.0001, 0.02), askew));
  // asked both ways: alone, the peg's points, 2.5 mm apart, would catch on the rim one after another
  const StructuresPtr socket = socketStructures({0.02, 0.02, 0.02}, 0.003, 0.000115, 0.001);
  rig.addStatic(peg, socket, Pose(), 0.0001);
  rig.addStaticShell(peg, socket, Pose(), 0.0001);
  // a person aligns while the tip finds the hole, but holds the peg askew again while pushing it home
  rig.moveHand(peg, Pose(Vector3(0.0002, -0.0001, 0.014), expRotation({0.01, 0.005, 0.0})), 100);
  rig.moveHand(peg, Pose(Vector3(0.0, 0.0, -0.0035), askew), 500);
  EXPECT_LT(rig.pose(peg).translation().z(), -0.0025);
  EXPECT_GT(rig.pose(peg).translation().z(), -0.005);
  EXPECT_LT(logRotation(rig.pose(peg).rotation()).norm(), 0.02) << "the hole turns it straight";
  EXPECT_GT(rig.deepest_overlap, -5e-5);

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
  EXPECT_GT(rig.deepest_overlap, -5e-5);
}

//   hand a ->  [cube] [part]  <- hand b
TEST(IslandSolver, ACubeAgainstAHeldPartIsFeltEquallyOnBothSides) {
  IslandRig rig;
  const StructuresPtr cube = boxStructures({0.03, 0.03, 0.03}, 0.002, 0.004);
  const StructuresPtr part = boxStructures({0.06, 0.05, 0.05}, 0.002, 0.004);
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
  EXPECT_GT(rig.pose(b).translation().x(), 0.001) << "the part gives way";
}

TEST(IslandSolver, ATurnedWorldGivesATurnedWrench) {
  const StructuresPtr box = boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004);
  const StructuresPtr corner = cornerStructures(0.12, 0.003);
  const Pose X_VW(Vector3(0.3, -0.2, 0.5), expRotation({0.4, -1.0, 0.7}));
  const auto run = [&](const Pose& X_VN) {
    IslandRig rig;
    const auto body = rig.addBody(box, X_VN * Pose(Vector3(0.04, 0.04, 0.04)));
    rig.addStatic(body, corner, X_VN, 0.0027);
    for (int tick = 0; tick < 100; ++tick) {
      const double way = 0.0005 * tick;
      rig.setHand(
          body, X_VN * Pose(Vector3(0.04 - way, 0.04 - way, 0.04 - way), expRotation({0.1 * way, 0.0, way})));
      rig.step();
    }
    return rig.force(0);
  };
  const Wrench here = run(Pose());
  const Wrench there = run(X_VW);
  EXPECT_GT(here.force.norm(), 10.0);
  EXPECT_LE((there.force - X_VW.rotation() * here.force).norm(), 1e-5 * here.force.norm());
}

TEST(IslandSolver, GivesTheSameBitsTwice) {
  const auto run = [] {
    IslandRig rig;
    const auto body =
        rig.addBody(boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004), Pose(Vector3(0.04, 0.04, 0.04)));
    rig.addStatic(body, cornerStructures(0.12, 0.003), Pose(), 0.0027);
    rig.moveHand(body, Pose(Vector3(-0.01, 0.0, -0.02), expRotation({0.4, 0.2, 0.1})), 150);
    return rig.pose(body);
  };
  EXPECT_TRUE(run() == run());
}

TEST(IslandSolver, WhatOneTickCannotTravelWaitsForTheNext) {
  IslandRig rig;
  const auto box = rig.addBody(boxStructures({0.02, 0.02, 0.02}, 0.002, 0.004), Pose());
  rig.limits.substeps = 4;
  rig.limits.substep_travel = 0.00025;
  rig.setHand(box, Pose(Vector3(0.0035, 0.0, 0.0)));
  EXPECT_TRUE(rig.step().travel_capped);
  EXPECT_NEAR(rig.pose(box).translation().x(), 0.001, 1e-12);
  EXPECT_TRUE(rig.step().travel_capped);
  EXPECT_TRUE(rig.step().travel_capped);
  EXPECT_FALSE(rig.step().travel_capped);
  EXPECT_TRUE(rig.pose(box) == Pose(Vector3(0.0035, 0.0, 0.0))) << "arrives exactly";
}

TEST(IslandSolver, AllocatesNothing) {
  IslandRig rig;
  const auto box =
      rig.addBody(boxStructures({0.04, 0.03, 0.02}, 0.002, 0.002), Pose(Vector3(0.04, 0.04, 0.04)));
  rig.addStatic(box, cornerStructures(0.12, 0.003), Pose(), 0.0027);
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

TEST(Baselines, PenaltyBodiesFollowTheirHandsIntoTheFloor) {
  IslandRig rig;
  rig.limits.method = ContactMethod::kPenalty;
  const auto box =
      rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, floorStructures(0.3, 0.002), Pose(), 0.0005);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, 0.009)), 50);
  EXPECT_NEAR(rig.pose(box).translation().z(), 0.009, 1e-9);
  // 1.5 mm in the dilated floor
  EXPECT_GT(rig.force(0).force.z(), 1000.0 * 0.0014 * 12.0);
  EXPECT_NEAR(rig.results[0].query.deepest, 0.001, 2e-6);
}

TEST(Baselines, BlockingStopsAtAFloorAndSlides) {
  IslandRig rig;
  rig.limits.method = ContactMethod::kBlocking;
  const auto box =
      rig.addBody(boxStructures({0.04, 0.04, 0.02}, 0.002, 0.004), Pose(Vector3(0.0, 0.0, 0.02)));
  rig.addStatic(box, floorStructures(0.4, 0.002), Pose(), 0.0015);
  rig.moveHand(box, Pose(Vector3(0.0, 0.0, -0.02)), 100);
  rig.moveHand(box, Pose(Vector3(0.05, 0.0, -0.02)), 100);
  EXPECT_NEAR(rig.pose(box).translation().x(), 0.05, 1e-3);
  EXPECT_GT(rig.pose(box).translation().z(), 0.01);  // the real floor holds
}

}  // namespace
}  // namespace tenon
