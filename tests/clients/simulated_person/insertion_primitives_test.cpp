#include "clients/simulated_person/insertion_primitives.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace tenon::simulated_person {
namespace {

constexpr double kStep = 1e-3;  // [s]
const Vector3 kDown(0.0, 0.0, -1.0);

TEST(InsertionPrimitives, UprightObjectsAreTouchedFromTheFrontAllOthersFromAbove) {
  EXPECT_EQ(touchNormal({0.1, 0.1, 0.3}), Vector3(0.0, -1.0, 0.0));
  EXPECT_EQ(touchNormal({0.3, 0.3, 0.1}), Vector3(0.0, 0.0, 1.0));
}

TEST(InsertionPrimitives, PushAdvancesBelowTheTargetForceAndYieldsAboveIt) {
  EXPECT_GT(pushStep(5.0, 4.0, 0.06, kStep), 0.0);
  EXPECT_EQ(pushStep(5.0, 5.0, 0.06, kStep), 0.0);
  EXPECT_LT(pushStep(5.0, 6.0, 0.06, kStep), 0.0);
  EXPECT_DOUBLE_EQ(pushStep(5.0, -100.0, 0.06, kStep), 0.06 * kStep);
}

TEST(InsertionPrimitives, LateralComplianceKeepsTheDepth) {
  const Pose X_WAim(Vector3(0.1, 0.2, 0.3));
  const Pose X_WO(Vector3(0.104, 0.2, 0.25));
  const Vector3 p_WHalf = compliedLaterally(X_WO, X_WAim, Vector3::Zero(), kDown, 0.5).translation();
  EXPECT_TRUE(p_WHalf.isApprox(Vector3(0.102, 0.2, 0.3), 1e-12)) << p_WHalf;
}

TEST(InsertionPrimitives, SmallTiltsAreCompliedWithVisibleTiltsAreCorrected) {
  const Pose X_WG;
  const Vector3 small(0.02, 0.0, 0.0);
  const Vector3 large(0.1, 0.0, 0.0);
  const Pose X_WSmall(Vector3::Zero(), expRotation(small));
  const Pose X_WLarge(Vector3::Zero(), expRotation(large));
  EXPECT_TRUE(logRotation(compliedInRotation(X_WSmall, X_WG, X_WG, Vector3::Zero(), 0.5).rotation())
                  .isApprox(0.5 * small, 1e-6));
  EXPECT_EQ(compliedInRotation(X_WLarge, X_WG, X_WG, Vector3::Zero(), 0.5), X_WG);
  EXPECT_EQ(tiltCorrection(Vector3::Zero(), X_WSmall, X_WG, kStep), Vector3::Zero());
  EXPECT_LT(tiltCorrection(Vector3::Zero(), X_WLarge, X_WG, kStep).x(), 0.0) << "against the tilt";
  EXPECT_NEAR(tiltCorrection({-10.0, 0.0, 0.0}, X_WLarge, X_WG, kStep).norm(), 0.3, 1e-12)
      << "bounded by the range of the wrist";
}

//   (((o)))  seen along the axis
TEST(InsertionPrimitives, SpiralSearchIsAnArchimedeanSpiralAcrossTheAxis) {
  SpiralSearch spiral;
  double turned = 0.0;
  Vector3 previous = spiral.offset(kDown);
  for (int tick = 0; tick < 4000; ++tick) {
    spiral.step(false, kStep);
    const Vector3 offset = spiral.offset(kDown);
    EXPECT_NEAR(offset.z(), 0.0, 1e-12);
    EXPECT_NEAR(offset.norm(), spiral.radius(), 0.01 * spiral.radius());
    if (tick > 0) turned += std::atan2(previous.cross(offset).norm(), previous.dot(offset));
    previous = offset;
  }
  constexpr double kPitch = 0.0008;  // [m] per revolution
  EXPECT_NEAR(spiral.radius(), kPitch * turned / (2.0 * std::numbers::pi), 0.01 * spiral.radius());
  EXPECT_LT(logRotation(spiral.tilt(kDown)).norm(), 0.05);

  SpiralSearch slower;
  slower.step(true, kStep);
  SpiralSearch faster;
  faster.step(false, kStep);
  EXPECT_LT(slower.radius(), faster.radius()) << "when the object begins to enter";
}

TEST(InsertionPrimitives, StallIsDetectedOnlyWithoutProgress) {
  StallDetector detector;
  detector.start(0.0);
  for (int tick = 0; tick < 2000; ++tick) EXPECT_FALSE(detector.stalled(1e-5 * tick, 0.001)) << tick;
  detector.start(0.02);
  int stalls = 0;
  for (int tick = 0; tick < 2000; ++tick) stalls += detector.stalled(0.02, 0.001) ? 1 : 0;
  EXPECT_GE(stalls, 4) << "every 0.4 s";
}

}  // namespace
}  // namespace tenon::simulated_person
