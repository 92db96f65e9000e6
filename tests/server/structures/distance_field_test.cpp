#include "server/structures/distance_field.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "server/structures/field_builder.h"

namespace tenon::structures {
namespace {

constexpr double kRadius = 0.05;
constexpr double kVoxel = 0.003;

double ballDistance(const Vector3& p) { return p.norm() - kRadius; }

DistanceField ball(std::vector<Eigen::AlignedBox3d> refine = {}, int refinement = 1) {
  const Vector3 corner = Vector3::Constant(kRadius);
  return buildField(ballDistance, {-corner, corner}, kVoxel, refine, refinement);
}

double boxDistance(const Vector3& p) {
  const Vector3 q = p.cwiseAbs() - Vector3(0.06, 0.04, 0.02);
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

DistanceField box() {
  const Vector3 corner(0.06, 0.04, 0.02);
  return buildField(boxDistance, {-corner, corner}, kVoxel);
}

/// A random point with coordinates in [-reach, reach].
Vector3 randomPoint(std::mt19937_64& random, double reach) {
  const auto coordinate = [&] {
    return (static_cast<double>(random() >> 11U) * 0x1p-53 * 2.0 - 1.0) * reach;
  };
  const double x = coordinate();
  const double y = coordinate();
  return {x, y, coordinate()};
}

TEST(DistanceField, IsTheDistanceToABallWithinTheBand) {
  const DistanceField field = ball();
  std::mt19937_64 random(1);
  int in_band = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vector3 p = randomPoint(random, 0.07);
    const FieldSample sample = field.sample(p);
    if (std::abs(ballDistance(p)) < field.band() - 0.001) {
      ASSERT_TRUE(sample.exact) << p.transpose();
    }
    if (!sample.exact) continue;
    ++in_band;
    EXPECT_NEAR(sample.distance, ballDistance(p), 0.02 * kVoxel);
    EXPECT_LT((sample.gradient - p.normalized()).norm(), 0.06);
  }
  EXPECT_GT(in_band, 3000);
}

TEST(DistanceField, OutsideTheBandIsALowerBoundWithTheRightSign) {
  const DistanceField field = ball();
  std::mt19937_64 random(2);
  int outside = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vector3 p = randomPoint(random, 0.2);
    const FieldSample sample = field.sample(p);
    if (sample.exact) continue;
    ++outside;
    EXPECT_EQ(sample.distance < 0.0, ballDistance(p) < 0.0) << p.transpose();
    EXPECT_LE(std::abs(sample.distance), std::abs(ballDistance(p)) + 1e-5) << p.transpose();
    EXPECT_EQ(sample.gradient, Vector3::Zero());
  }
  EXPECT_GT(outside, 1000);
}

TEST(DistanceField, LowerBoundIsNeverAboveTheDistanceNorAboveAnExactSample) {
  const Vector3 half = Vector3::Constant(0.5);
  for (const DistanceField& field : {box(), ball({{-half, half}}, 4)}) {
    const bool is_ball = field.layout().refinement > 1;
    std::mt19937_64 random(3);
    for (int i = 0; i < 50'000; ++i) {
      const Vector3 p = randomPoint(random, 0.15);
      const double bound = field.lowerBound(p);
      EXPECT_LE(bound, (is_ball ? ballDistance(p) : boxDistance(p)) + 1e-12) << p.transpose();
      const FieldSample sample = field.sample(p);
      if (sample.exact) {
        EXPECT_LE(bound, sample.distance) << p.transpose();
      }
    }
  }
}

TEST(DistanceField, LowerBoundHoldsForAWholeBall) {
  const Vector3 half = Vector3::Constant(0.5);
  for (const DistanceField& field : {box(), ball({{-half, half}}, 4)}) {
    const bool is_ball = field.layout().refinement > 1;
    std::mt19937_64 random(4);
    for (int i = 0; i < 50'000; ++i) {
      const Vector3 p = randomPoint(random, 0.15);
      const double radius = 0.03 * std::abs(randomPoint(random, 1.0).x());
      const double bound = field.lowerBound(p, radius);
      const Vector3 in_ball = p + radius * randomPoint(random, 1.0).normalized();
      EXPECT_LE(bound, (is_ball ? ballDistance(in_ball) : boxDistance(in_ball)) + 1e-12) << p.transpose();
      const FieldSample sample = field.sample(in_ball);
      if (sample.exact) {
        EXPECT_LE(bound, sample.distance) << p.transpose();
      }
    }
  }
}

TEST(DistanceField, LowerBoundGrowsWithTheDistanceSoThatPruningWorks) {
  const DistanceField field = ball();
  EXPECT_GT(field.lowerBound(Vector3(0.3, 0.0, 0.0)), 0.22);
  EXPECT_GT(field.lowerBound(Vector3(0.0, 0.0, -0.075)), 0.005);
}

TEST(DistanceField, RefinedBricksApproximateTheSurfaceMoreClosely) {
  const Vector3 half = Vector3::Constant(0.5);
  const DistanceField coarse = ball();
  const DistanceField fine = ball({{Vector3(0.0, -0.5, -0.5), half}}, 4);
  double worst_coarse = 0.0;
  double worst_fine = 0.0;
  std::mt19937_64 random(4);
  for (int i = 0; i < 5'000; ++i) {
    Vector3 p = randomPoint(random, 1.0).normalized() * kRadius;
    p.x() = std::abs(p.x());
    worst_coarse = std::max(worst_coarse, std::abs(coarse.sample(p).distance));
    worst_fine = std::max(worst_fine, std::abs(fine.sample(p).distance));
    EXPECT_DOUBLE_EQ(fine.voxelAt(p), kVoxel / 4);
  }
  EXPECT_LT(worst_fine, worst_coarse / 8);
  EXPECT_DOUBLE_EQ(fine.voxelAt(Vector3(-kRadius, 0.0, 0.0)), kVoxel);
}

TEST(DistanceField, RefinementDoesNotNarrowTheBand) {
  const Vector3 half = Vector3::Constant(0.5);
  const DistanceField field = ball({{-half, half}}, 4);
  const FieldSample sample = field.sample(Vector3(kRadius + 0.009, 0.001, 0.002));
  EXPECT_TRUE(sample.exact);
  EXPECT_NEAR(sample.distance, ballDistance(Vector3(kRadius + 0.009, 0.001, 0.002)), 1e-4);
}

TEST(DistanceField, ASampleAtNanIsNotExact) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(ball().sample(Vector3(nan, 0.0, 0.0)).exact);
}

}  // namespace
}  // namespace tenon::structures
