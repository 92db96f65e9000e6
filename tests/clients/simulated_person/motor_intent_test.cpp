#include "clients/simulated_person/motor_intent.h"

#include <gtest/gtest.h>

namespace tenon::simulated_person {
namespace {

TEST(MotorIntent, FollowsWhatAPersonWantsWithoutLagAndAJumpOfTheSceneAtTheSpeedOfAnArm) {
  MotorIntent intent;
  EXPECT_EQ(intent.towards(Pose(Vector3(0.1, 0, 0))).translation(), Vector3(0.1, 0, 0)) << "the first one";
  Vector3 p_DI(0.1, 0, 0);
  for (int tick = 0; tick < 1000; ++tick) {
    p_DI.y() += 0.0003;
    EXPECT_TRUE(intent.towards(Pose(p_DI)).translation().isApprox(p_DI, 1e-12)) << "0.3 m/s";
  }
  const Vector3 target = p_DI + Vector3(0, 0, 0.12);
  Vector3 before = p_DI;
  int ticks = 0;
  while ((before - target).norm() > 1e-9 && ticks < 1000) {
    const Vector3 now = intent.towards(Pose(target)).translation();
    EXPECT_LE((now - before).norm(), MotorIntent::kSpeed * kTickSeconds + 1e-12);
    before = now;
    ++ticks;
  }
  EXPECT_NEAR(ticks, 274, 2) << "from 0.3 m/s on";
  intent.reset();
  EXPECT_EQ(intent.towards(Pose(Vector3::Zero())).translation(), Vector3::Zero());
}

}  // namespace
}  // namespace tenon::simulated_person
