#include "server/collision/ridge_correction.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/pair_query.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

using test::SeededRandom;
using test::StructuresPtr;

constexpr double kVoxel = 0.003;  // [m]

/// An analytic shape, rotated so that none of its faces is parallel to the grid.
struct TestShape {
  explicit TestShape(structures::AnalyticDistance about_S)
      : X_MS(Vector3(0.0011, -0.0007, 0.0004), expRotation({0.4, -0.7, 0.3})),
        truth(test::movedDistance(std::move(about_S), X_MS)),
        structures(
            test::analyticStructures(truth, {Vector3::Constant(-0.06), Vector3::Constant(0.06)}, kVoxel)) {}

  [[nodiscard]] Vector3 normalAt(const Vector3& p_MP) const {
    constexpr double kStep = 1e-7;
    Vector3 slope;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3 step = kStep * Vector3::Unit(axis);
      slope[axis] = truth(p_MP + step) - truth(p_MP - step);
    }
    return slope.normalized();
  }

  Pose X_MS;
  structures::AnalyticDistance truth;
  test::StructuresPtr structures;
};

/// Errors of the depths and normals of contacts inside, sorted.
struct CorrectionErrors {
  std::vector<double> depth;   ///< [m]
  std::vector<double> normal;  ///< [-] length of the difference

  void sort() {
    std::sort(depth.begin(), depth.end());
    std::sort(normal.begin(), normal.end());
  }
  static double at(const std::vector<double>& sorted, double fraction) {
    return sorted[static_cast<std::size_t>(fraction * static_cast<double>(sorted.size() - 1))];
  }
};

/// Errors of a ball at random poses on a shape.
CorrectionErrors errorsIn(const TestShape& shape, bool correct_ridges) {
  const test::StructuresPtr ball = test::sphereStructures(0.012, kVoxel, 0.002);
  const auto result = std::make_unique<PairQueryResult>();
  test::SeededRandom random(5);
  CorrectionErrors errors;
  for (int trial = 0; trial < 400; ++trial) {
    const Pose X_WA = shape.X_MS * Pose(0.03 * random.vector(), expRotation(random.vector()));
    PairQuery query{&ball->shell, &shape.structures->field, X_WA, Pose()};
    query.correct_ridges = correct_ridges;
    queryPair(query, *result);
    for (const Contact& contact : result->contacts) {
      errors.depth.push_back(std::abs(contact.gap - shape.truth(contact.p_WP)));
      errors.normal.push_back((contact.n_W - shape.normalAt(contact.p_WP)).norm());
    }
  }
  errors.sort();
  return errors;
}

class ThinWall : public testing::TestWithParam<double> {};

TEST_P(ThinWall, CorrectedDepthsAndNormalsAreThoseOfTheNearestFace) {
  const TestShape wall(test::boxDistance({0.07, 0.07, GetParam() * kVoxel}));
  const CorrectionErrors interpolated = errorsIn(wall, false);
  const CorrectionErrors corrected = errorsIn(wall, true);
  ASSERT_GT(corrected.depth.size(), 1000U);
  EXPECT_GT(CorrectionErrors::at(interpolated.depth, 0.95), 0.1 * kVoxel);
  EXPECT_LE(CorrectionErrors::at(corrected.depth, 0.95), 0.01 * kVoxel);
  EXPECT_LE(CorrectionErrors::at(corrected.normal, 0.9), 0.1);
  EXPECT_GT(CorrectionErrors::at(interpolated.normal, 0.9), 0.2);
}

INSTANTIATE_TEST_SUITE_P(OneToFourVoxels, ThinWall, testing::Values(1.2, 1.5, 2.0, 2.7, 3.5));

TEST(RidgeCorrection, UnderEdgesDepthsAreThoseOfTheNearestFace) {
  const TestShape bar(test::boxDistance({0.05, 0.014, 0.011}));
  const CorrectionErrors interpolated = errorsIn(bar, false);
  const CorrectionErrors corrected = errorsIn(bar, true);
  EXPECT_GT(CorrectionErrors::at(interpolated.depth, 0.9), 0.2 * kVoxel);
  EXPECT_LE(CorrectionErrors::at(corrected.depth, 0.9), 0.04 * kVoxel);
  EXPECT_LE(CorrectionErrors::at(corrected.depth, 0.99), CorrectionErrors::at(interpolated.depth, 0.99));
}

TEST(RidgeCorrection, OnASphereItIsNoWorseThanInterpolation) {
  const TestShape ball(test::sphereDistance(0.009));
  const CorrectionErrors interpolated = errorsIn(ball, false);
  const CorrectionErrors corrected = errorsIn(ball, true);
  for (const double fraction : {0.5, 0.9, 0.99}) {
    EXPECT_LE(CorrectionErrors::at(corrected.depth, fraction),
              1.02 * CorrectionErrors::at(interpolated.depth, fraction))
        << fraction;
  }
}

TEST(CorrectedSample, HasTheDepthsOfAThinWallAndLeavesOutsideAsItIs) {
  const TestShape wall(test::boxDistance({0.08, 0.08, 2.0 * kVoxel}));
  test::SeededRandom random(9);
  CorrectionErrors interpolated;
  CorrectionErrors corrected;
  int outside = 0;
  while (corrected.depth.size() < 2000) {
    const Vector3 p_MP = wall.X_MS * (Vector3(0.03, 0.03, 1.5 * kVoxel).cwiseProduct(random.vector()));
    const structures::FieldSample field = wall.structures->field.sample(p_MP);
    const structures::FieldSample sample = correctedSample(wall.structures->field, p_MP);
    if (field.distance >= 0.0) {
      ++outside;
      ASSERT_EQ(sample.distance, field.distance);
      ASSERT_EQ(sample.gradient, field.gradient);
      continue;
    }
    const double truth = wall.truth(p_MP);
    interpolated.depth.push_back(std::abs(field.distance - truth));
    corrected.depth.push_back(std::abs(sample.distance - truth));
  }
  interpolated.sort();
  corrected.sort();
  EXPECT_GT(outside, 300);
  EXPECT_GT(CorrectionErrors::at(interpolated.depth, 0.95), 0.1 * kVoxel);
  EXPECT_LE(CorrectionErrors::at(corrected.depth, 0.95), 0.01 * kVoxel);
}

TEST(RidgeCorrection, LeavesAFloorUnchangedAndAConcaveCornerNearly) {
  const test::StructuresPtr box = test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004);
  const test::StructuresPtr floor = test::floorStructures(0.2, kVoxel);
  const test::StructuresPtr corner = test::cornerStructures(0.1, kVoxel);
  const auto interpolated = std::make_unique<PairQueryResult>();
  const auto corrected = std::make_unique<PairQueryResult>();
  test::SeededRandom random(6);
  std::size_t seen = 0;
  std::size_t changed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const bool on_floor = trial % 2 == 0;
    const Vector3 p(0.018 + 0.004 * random.symmetric(), 0.014 + 0.004 * random.symmetric(), 0.0085);
    const Pose X_WA(p, expRotation(0.1 * random.vector()));
    PairQuery query{&box->shell, on_floor ? &floor->field : &corner->field, X_WA, Pose()};
    queryPair(query, *interpolated);
    query.correct_ridges = true;
    queryPair(query, *corrected);
    ASSERT_EQ(interpolated->contacts.size(), corrected->contacts.size());
    for (std::size_t i = 0; i < interpolated->contacts.size(); ++i) {
      const double change = std::abs(interpolated->contacts[i].gap - corrected->contacts[i].gap);
      if (on_floor) {
        ASSERT_EQ(change, 0.0);
      }
      ASSERT_LT(change, 0.15 * kVoxel);
      ++seen;
      changed += change > 0.02 * kVoxel ? 1U : 0U;
    }
  }
  EXPECT_LE(1000U * changed, seen);
}

TEST(RidgeCorrection, NeverReducesADepthOrLosesAContact) {
  const TestShape wall(test::boxDistance({0.05, 0.03, 0.005}));
  const test::StructuresPtr ball = test::sphereStructures(0.012, kVoxel, 0.003);
  const auto interpolated = std::make_unique<PairQueryResult>();
  const auto corrected = std::make_unique<PairQueryResult>();
  test::SeededRandom random(7);
  std::size_t deeper = 0;
  for (int trial = 0; trial < 300; ++trial) {
    PairQuery query{&ball->shell, &wall.structures->field, Pose(0.03 * random.vector()), Pose()};
    query.margin = 0.001;
    queryPair(query, *interpolated);
    query.correct_ridges = true;
    queryPair(query, *corrected);
    ASSERT_EQ(interpolated->contacts.size(), corrected->contacts.size());
    for (std::size_t i = 0; i < interpolated->contacts.size(); ++i) {
      ASSERT_EQ(interpolated->contacts[i].point, corrected->contacts[i].point);
      ASSERT_LE(corrected->contacts[i].gap, interpolated->contacts[i].gap);
      ASSERT_LE(corrected->smallest_gap, corrected->contacts[i].gap);
      deeper += corrected->contacts[i].gap < interpolated->contacts[i].gap ? 1U : 0U;
    }
  }
  EXPECT_GT(deeper, 100U);
}

}  // namespace
}  // namespace tenon::collision
