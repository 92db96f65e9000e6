#include "server/collision/straightening.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/pair_query.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"

namespace tenon {
namespace {

using test::Chance;
using test::StructuresPtr;

constexpr double kVoxel = 0.003;

/// A shape with its formula, turned so that none of its faces lies along the grid.
struct Shape {
  explicit Shape(AnalyticDistance about_S)
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
  AnalyticDistance truth;
  StructuresPtr structures;
};

/// What contacts inside say against the truth; sorted.
struct Errors {
  std::vector<double> depth;   ///< [m]
  std::vector<double> normal;  ///< length of the difference

  void sort() {
    std::sort(depth.begin(), depth.end());
    std::sort(normal.begin(), normal.end());
  }
  static double at(const std::vector<double>& sorted, double share) {
    return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
  }
};

/// A ball in many places about a shape.
Errors errorsIn(const Shape& shape, bool straighten) {
  const StructuresPtr ball = test::sphereStructures(0.012, kVoxel, 0.002);
  const auto result = std::make_unique<PairQueryResult>();
  Chance chance(5);
  Errors errors;
  for (int trial = 0; trial < 400; ++trial) {
    const Pose X_WA = shape.X_MS * Pose(0.03 * chance.vector(), expRotation(chance.vector()));
    PairQuery query{&ball->shell, &shape.structures->field, X_WA, Pose()};
    query.straighten = straighten;
    queryPair(query, *result);
    for (const Contact& contact : result->contacts) {
      errors.depth.push_back(std::abs(contact.gap - shape.truth(contact.p_WP)));
      errors.normal.push_back((contact.n_W - shape.normalAt(contact.p_WP)).norm());
    }
  }
  errors.sort();
  return errors;
}

class WallsOf : public testing::TestWithParam<double> {};

TEST_P(WallsOf, AreAsDeepAsTheyAre) {
  const Shape wall(test::boxDistance({0.07, 0.07, GetParam() * kVoxel}));
  const Errors interpolated = errorsIn(wall, false);
  const Errors straightened = errorsIn(wall, true);
  ASSERT_GT(straightened.depth.size(), 1000U);
  EXPECT_GT(Errors::at(interpolated.depth, 0.95), 0.1 * kVoxel);
  EXPECT_LE(Errors::at(straightened.depth, 0.95), 0.01 * kVoxel);
  EXPECT_LE(Errors::at(straightened.normal, 0.9), 0.1);
  EXPECT_GT(Errors::at(interpolated.normal, 0.9), 0.2);
}

INSTANTIATE_TEST_SUITE_P(OneToFourVoxels, WallsOf, testing::Values(1.2, 1.5, 2.0, 2.7, 3.5));

TEST(Straightening, UnderTheEdgesOfABarDepthsAreThoseOfTheNearestFace) {
  const Shape bar(test::boxDistance({0.05, 0.014, 0.011}));
  const Errors interpolated = errorsIn(bar, false);
  const Errors straightened = errorsIn(bar, true);
  EXPECT_GT(Errors::at(interpolated.depth, 0.9), 0.2 * kVoxel);
  EXPECT_LE(Errors::at(straightened.depth, 0.9), 0.04 * kVoxel);
  EXPECT_LE(Errors::at(straightened.depth, 0.99), Errors::at(interpolated.depth, 0.99));
}

TEST(Straightening, OfARoundThingIsNoWorseThanInterpolation) {
  const Shape ball(test::sphereDistance(0.009));
  const Errors interpolated = errorsIn(ball, false);
  const Errors straightened = errorsIn(ball, true);
  for (const double share : {0.5, 0.9, 0.99}) {
    EXPECT_LE(Errors::at(straightened.depth, share), 1.02 * Errors::at(interpolated.depth, share)) << share;
  }
}

TEST(Straightening, LeavesAFloorAloneAndAnInnerCornerNearly) {
  const StructuresPtr box = test::boxStructures({0.04, 0.03, 0.02}, 0.002, 0.004);
  const StructuresPtr floor = test::floorStructures(0.2, kVoxel);
  const StructuresPtr corner = test::cornerStructures(0.1, kVoxel);
  const auto plain = std::make_unique<PairQueryResult>();
  const auto straight = std::make_unique<PairQueryResult>();
  Chance chance(6);
  std::size_t seen = 0;
  std::size_t changed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const bool on_floor = trial % 2 == 0;
    const Vector3 p(0.018 + 0.004 * chance.number(), 0.014 + 0.004 * chance.number(), 0.0085);
    const Pose X_WA(p, expRotation(0.1 * chance.vector()));
    PairQuery query{&box->shell, on_floor ? &floor->field : &corner->field, X_WA, Pose()};
    queryPair(query, *plain);
    query.straighten = true;
    queryPair(query, *straight);
    ASSERT_EQ(plain->contacts.size(), straight->contacts.size());
    for (std::size_t i = 0; i < plain->contacts.size(); ++i) {
      const double change = std::abs(plain->contacts[i].gap - straight->contacts[i].gap);
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

TEST(Straightening, MakesNothingLessDeepAndLosesNoContact) {
  const Shape wall(test::boxDistance({0.05, 0.03, 0.005}));
  const StructuresPtr ball = test::sphereStructures(0.012, kVoxel, 0.003);
  const auto plain = std::make_unique<PairQueryResult>();
  const auto straight = std::make_unique<PairQueryResult>();
  Chance chance(7);
  std::size_t deeper = 0;
  for (int trial = 0; trial < 300; ++trial) {
    PairQuery query{&ball->shell, &wall.structures->field, Pose(0.03 * chance.vector()), Pose()};
    query.margin = 0.001;
    queryPair(query, *plain);
    query.straighten = true;
    queryPair(query, *straight);
    ASSERT_EQ(plain->contacts.size(), straight->contacts.size());
    for (std::size_t i = 0; i < plain->contacts.size(); ++i) {
      ASSERT_EQ(plain->contacts[i].point, straight->contacts[i].point);
      ASSERT_LE(straight->contacts[i].gap, plain->contacts[i].gap);
      ASSERT_LE(straight->smallest_gap, straight->contacts[i].gap);
      deeper += straight->contacts[i].gap < plain->contacts[i].gap ? 1U : 0U;
    }
  }
  EXPECT_GT(deeper, 100U);
}

}  // namespace
}  // namespace tenon
