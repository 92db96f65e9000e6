#include "clients/trainee/assembly_abilities.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr double kDt = 1e-3;  // [s]
const Vector3 kDown(0.0, 0.0, -1.0);

TEST(AssemblyAbilities, WhatStandsIsTouchedFromTheFrontWhatLiesFromAbove) {
  EXPECT_EQ(sideToTouch({0.1, 0.1, 0.3}), Vector3(0.0, -1.0, 0.0));
  EXPECT_EQ(sideToTouch({0.3, 0.3, 0.1}), Vector3(0.0, 0.0, 1.0));
}

TEST(AssemblyAbilities, AHandFollowsUntilTheWantedForceAndGivesWayBeyond) {
  EXPECT_GT(pushStep(5.0, 4.0, 0.06, kDt), 0.0);
  EXPECT_EQ(pushStep(5.0, 5.0, 0.06, kDt), 0.0);
  EXPECT_LT(pushStep(5.0, 6.0, 0.06, kDt), 0.0);
  EXPECT_DOUBLE_EQ(pushStep(5.0, -100.0, 0.06, kDt), 0.06 * kDt);
}

TEST(AssemblyAbilities, YieldingGoesSidewaysOnly) {
  const Pose X_WAim(Vector3(0.1, 0.2, 0.3));
  const Pose X_WO(Vector3(0.104, 0.2, 0.25));
  const Vector3 p_WHalf = yieldedTo(X_WO, X_WAim, kDown, 0.5).translation();
  EXPECT_TRUE(p_WHalf.isApprox(Vector3(0.102, 0.2, 0.3), 1e-12)) << p_WHalf;
}

TEST(AssemblyAbilities, AHandTakesOnASmallTiltAndTurnsAgainstALargeOne) {
  const Pose X_WG;
  const Vector3 small(0.02, 0.0, 0.0);
  const Vector3 large(0.1, 0.0, 0.0);
  const Pose X_WSmall(Vector3::Zero(), expRotation(small));
  const Pose X_WLarge(Vector3::Zero(), expRotation(large));
  EXPECT_TRUE(logRotation(compliedWith(X_WSmall, X_WG, X_WG, 0.5).rotation()).isApprox(0.5 * small, 1e-6));
  EXPECT_EQ(compliedWith(X_WLarge, X_WG, X_WG, 0.5), X_WG);
  EXPECT_EQ(uprightAgain(Vector3::Zero(), X_WSmall, X_WG, kDt), Vector3::Zero());
  EXPECT_LT(uprightAgain(Vector3::Zero(), X_WLarge, X_WG, kDt).x(), 0.0) << "the other way";
  EXPECT_NEAR(uprightAgain({-10.0, 0.0, 0.0}, X_WLarge, X_WG, kDt).norm(), 0.3, 1e-12)
      << "a wrist has an end";
}

//   (((o)))  seen along the axis
TEST(AssemblyAbilities, TheWiggleIsASpiralOnTheFace) {
  Wiggle wiggle;
  double turned = 0.0;
  Vector3 before = wiggle.way(kDown);
  for (int tick = 0; tick < 4000; ++tick) {
    wiggle.step(false, kDt);
    const Vector3 way = wiggle.way(kDown);
    EXPECT_NEAR(way.z(), 0.0, 1e-12);
    EXPECT_NEAR(way.norm(), wiggle.radius(), 0.01 * wiggle.radius());
    if (tick > 0) turned += std::atan2(before.cross(way).norm(), before.dot(way));
    before = way;
  }
  constexpr double kPitch = 0.0008;  // [m] a turn
  EXPECT_NEAR(wiggle.radius(), kPitch * turned / (2.0 * std::numbers::pi), 0.01 * wiggle.radius());
  EXPECT_LT(logRotation(wiggle.tilt(kDown)).norm(), 0.05);

  Wiggle slower;
  slower.step(true, kDt);
  Wiggle faster;
  faster.step(false, kDt);
  EXPECT_LT(slower.radius(), faster.radius()) << "near the way in";
}

TEST(AssemblyAbilities, APushThatGoesOnDoesNotStall) {
  StallWatch watch;
  watch.start(0.0);
  for (int tick = 0; tick < 2000; ++tick) EXPECT_FALSE(watch.stalled(1e-5 * tick, 0.001)) << tick;
  watch.start(0.02);
  int stalls = 0;
  for (int tick = 0; tick < 2000; ++tick) stalls += watch.stalled(0.02, 0.001) ? 1 : 0;
  EXPECT_GE(stalls, 4) << "every 0.4 s";
}

}  // namespace
}  // namespace tenon
