#include "server/collision/valley_correction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

constexpr double kValleyVoxel = 0.001;  // [m]

/// Errors of sampled distances near the surface, before and after the correction.
struct ValleyErrors {
  double mean_before = 0.0, mean_after = 0.0;  ///< [voxels]
  double largest_rise = 0.0;                   ///< [voxels] above the truth, of what was corrected
  int corrected = 0;
  int samples = 0;
};

/// At random points within half a voxel of the surface of a shape that is turned in its grid in many ways.
ValleyErrors errorsOf(const structures::AnalyticDistance& about_S) {
  test::SeededRandom random(7);
  ValleyErrors errors;
  for (int turn = 0; turn < 6; ++turn) {
    const Pose X_MS(0.0005 * random.vector(), expRotation(2.0 * random.vector()));
    const structures::AnalyticDistance truth = test::movedDistance(about_S, X_MS);
    const auto shape =
        test::analyticStructures(truth, {Vector3::Constant(-0.012), Vector3::Constant(0.012)}, kValleyVoxel);
    for (int i = 0; i < 3000; ++i) {
      const Vector3 p = X_MS * Vector3(0.002 * random.vector());
      const double exact = truth(p);
      const structures::FieldSample before = shape->field.sample(p);
      if (!before.exact || std::abs(exact) > 0.5 * kValleyVoxel) continue;
      const structures::FieldSample after = sampleInValley(shape->field, p);
      ++errors.samples;
      errors.mean_before += std::abs(before.distance - exact) / kValleyVoxel;
      errors.mean_after += std::abs(after.distance - exact) / kValleyVoxel;
      EXPECT_GE(after.distance, before.distance);
      if (after.distance == before.distance) continue;
      ++errors.corrected;
      errors.largest_rise = std::max(errors.largest_rise, (after.distance - exact) / kValleyVoxel);
    }
  }
  errors.mean_before /= errors.samples;
  errors.mean_after /= errors.samples;
  return errors;
}

/// Free space between two half-planes that enclose `angle` [rad] about z.
structures::AnalyticDistance wedge(double angle) {
  return [angle](const Vector3& p) {
    const double a = p.y();
    const double b = std::sin(angle) * p.x() - std::cos(angle) * p.y();
    const double cosine = -std::cos(angle);
    if ((a < 0.0 || b < 0.0) && a - cosine * b < 0.0 && b - cosine * a < 0.0)
      return -std::hypot(p.x(), p.y());
    return std::min(a, b);
  };
}

//  \  /   free space above, material below
//   \/
TEST(ValleyCorrection, GivesTheDistanceToTheNearerFaceOfAConcaveEdge) {
  for (const double degrees : {60.0, 85.0, 87.5, 90.0, 120.0}) {
    const ValleyErrors errors = errorsOf(wedge(degrees * std::numbers::pi / 180.0));
    EXPECT_LT(errors.mean_after, 0.25 * errors.mean_before) << degrees;
    EXPECT_GT(errors.corrected, errors.samples / 10) << degrees;
  }
}

TEST(ValleyCorrection, LeavesConvexEdgesAsTheyAre) {
  const Pose X_SB(Vector3(-0.01, -0.01, 0.0));
  for (const auto& shape : {test::movedDistance(test::boxDistance(Vector3(0.02, 0.02, 0.1)), X_SB),
                            test::boxDistance(Vector3(0.004, 0.005, 0.003))}) {
    // noise of the samples raises a few in thousands, and none above the truth
    const ValleyErrors errors = errorsOf(shape);
    EXPECT_LT(errors.corrected, errors.samples / 500);
    EXPECT_LT(errors.largest_rise, 0.05);
  }
}

//   |#|      a rib of less than a voxel stands on a floor
//  _|#|___
TEST(ValleyCorrection, DoesNotOpenARib) {
  const structures::AnalyticDistance rib = [](const Vector3& p) {
    const Vector3 q = (p - Vector3(0.0, 0.004, 0.0)).cwiseAbs() - Vector3(0.00025, 0.004, 0.05);
    const double box = q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
    return p.y() < 0.0 ? p.y() : std::min(p.y(), box);
  };
  EXPECT_LT(errorsOf(rib).largest_rise, 0.1);
}

}  // namespace
}  // namespace tenon::collision
