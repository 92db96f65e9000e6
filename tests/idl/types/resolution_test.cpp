#include "idl/types/resolution.h"

#include <cmath>
#include <cstdint>
#include <limits>

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr std::int32_t kNoSteps = std::numeric_limits<std::int32_t>::min();

TEST(Resolution, RoundsToTheNearestStepAndOnlyOnce) {
  EXPECT_EQ(toSteps(2.4 * kPositionStep, kPositionStep), 2);
  EXPECT_EQ(toSteps(-2.6 * kPositionStep, kPositionStep), -3);
  EXPECT_EQ(toSteps(0.5 * kPositionStep, kPositionStep), 1);
  EXPECT_EQ(toSteps(-0.5 * kPositionStep, kPositionStep), -1);
  const Pose X(Vector3(0.1, -1.7, 120.0), expRotation(Vector3(0.3, -0.2, 1.0)));
  const Pose once = rounded(X);
  EXPECT_EQ(rounded(once), once);
  EXPECT_LE((once.translation() - X.translation()).cwiseAbs().maxCoeff(), 0.5 * kPositionStep);
  EXPECT_LT(displacement(X, once).rotation.norm(), 4.0 * kRotationStep);
  EXPECT_NEAR(once.rotation().norm(), 1.0, 2.0 * kRotationStep);
}

TEST(Resolution, WhatDoesNotFitIsTheSmallestNumber) {
  for (const double value : {129.0, -129.0, 1e300, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(toSteps(value, kPositionStep), kNoSteps) << value;
  EXPECT_EQ(toSteps(127.9, kPositionStep), static_cast<std::int32_t>(std::round(127.9 / kPositionStep)));
  EXPECT_LT(fromSteps(kNoSteps, kPositionStep), -127.0) << "no server takes it for a hand's position";
}

}  // namespace
}  // namespace tenon
