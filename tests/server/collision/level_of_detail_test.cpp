#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/pair_query.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

using test::StructuresPtr;

constexpr double kPenaltyStiffness = 1000.0;  // [N/m]
constexpr std::uint32_t kAllLevels = 0xFFFFFFFFU;

struct Penalty {
  Wrench F_Ao_W;
  std::uint32_t points = 0;
};

Penalty penaltyAt(const test::StructuresPtr& a, const test::StructuresPtr& b, const Pose& X_WA,
                  std::uint32_t levels) {
  PairQuery query{&a->shell, &b->field, X_WA, Pose(), 0.0, levels};
  query.sum_penalty = true;
  static const auto result = std::make_unique<PairQueryResult>();
  queryPair(query, *result);
  return {result->penalty_Ao_W * kPenaltyStiffness, result->penalty_points};
}

/// Uniform in [-1, 1).
double uniform(std::mt19937_64& engine) {
  return 2.0 * (static_cast<double>(engine() >> 11U) / 9007199254740992.0) - 1.0;
}

double p95(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() * 95 / 100];
}

/// A block with three balls, sampled irregularly as by a bake.
test::StructuresPtr blockWithBalls() {
  const Vector3 block(0.08, 0.05, 0.03);
  std::vector<structures::SurfaceSample> samples = test::boxSamples(block, 0.0012);
  structures::AnalyticDistance distance = test::boxDistance(block);
  for (const Vector3& p :
       {Vector3(0.03, 0.015, 0.015), Vector3(-0.02, -0.02, 0.015), Vector3(0.0, 0.01, -0.015)}) {
    std::erase_if(samples,
                  [&](const structures::SurfaceSample& sample) { return (sample.p_MP - p).norm() < 0.012; });
    for (structures::SurfaceSample sample : test::sphereSamples(0.012, 0.0012)) {
      sample.p_MP += p;
      if (test::boxDistance(block)(sample.p_MP) > 0.0) samples.push_back(sample);
    }
    distance = test::unionDistance(distance, test::movedDistance(test::sphereDistance(0.012), Pose(p)));
  }
  return test::analyticStructures(
      distance, Eigen::AlignedBox3d(Vector3(-0.045, -0.035, -0.03), Vector3(0.045, 0.03, 0.03)), 0.002,
      samples, 0.0012);
}

/// Errors of the force of coarser levels with respect to that of all points.
struct ForceErrors {
  std::vector<double> sizes;   ///< [-] relative error of the magnitude
  std::vector<double> angles;  ///< [rad]

  void add(const Wrench& coarse, const Wrench& full) {
    sizes.push_back(std::abs(coarse.force.norm() / full.force.norm() - 1.0));
    const double cosine = coarse.force.normalized().dot(full.force.normalized());
    angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)));
  }
};

/// Moves along `down` until the deepest point is about `depth` inside; false when that is not reached.
bool moveToDepth(const test::StructuresPtr& shell, const test::StructuresPtr& field, const Vector3& down,
                 double depth, Pose& X_WA) {
  const auto result = std::make_unique<PairQueryResult>();
  for (int step = 0; step < 60; ++step) {
    queryPair({&shell->shell, &field->field, X_WA, Pose(), 0.001}, *result);
    const double remaining = result->smallest_gap + depth;
    if (remaining < 1e-5) return true;
    X_WA.translation() += remaining * down;
  }
  return false;
}

// Random orientations, up to 4 mm deep.
TEST(LevelOfDetail, CoarserLevelsGiveAboutTheSameForce) {
  struct Against {
    test::StructuresPtr field;
    Vector3 p_WA;  ///< start of the descent
  };
  const std::vector<test::StructuresPtr> shells{test::sphereStructures(0.04, 0.002, 0.001),
                                                test::boxStructures({0.1, 0.06, 0.04}, 0.002, 0.001),
                                                blockWithBalls()};
  const std::vector<Against> against{{test::floorStructures(0.6, 0.004), {0.0, 0.0, 0.2}},
                                     {test::cornerStructures(0.4, 0.004), {0.15, 0.15, 0.15}},
                                     {test::sphereStructures(0.06, 0.002, 0.005), {0.0, 0.0, 0.2}}};
  std::mt19937_64 engine(5);
  ForceErrors errors;
  for (const test::StructuresPtr& shell : shells) {
    const auto levels = static_cast<std::uint32_t>(shell->shell.levels().size());
    ASSERT_GE(levels, 4U);
    for (const auto& [field, p_WA] : against) {
      for (int trial = 0; trial < 150; ++trial) {
        const Vector3 turn(uniform(engine), uniform(engine), uniform(engine));
        Pose X_WA(p_WA, expRotation(2.0 * turn));
        const Vector3 down = Vector3(0.5 * uniform(engine), 0.5 * uniform(engine), -1.0).normalized();
        const double depth = 0.0002 + 0.0019 * (1.0 + uniform(engine));
        if (!moveToDepth(shell, field, down, depth, X_WA)) continue;
        const Penalty full = penaltyAt(shell, field, X_WA, kAllLevels);
        for (std::uint32_t used = 1; used < levels; ++used) {
          const Penalty coarse = penaltyAt(shell, field, X_WA, used);
          if (coarse.points >= 30) errors.add(coarse.F_Ao_W, full.F_Ao_W);
        }
      }
    }
  }
  ASSERT_GT(errors.sizes.size(), 500U);
  constexpr double kTenDegrees = 0.1745;
  EXPECT_LT(p95(errors.sizes), 0.15);
  EXPECT_LT(p95(errors.angles), kTenDegrees);
  RecordProperty("size_p95", std::to_string(p95(errors.sizes)));
  RecordProperty("angle_p95_rad", std::to_string(p95(errors.angles)));
}

const test::StructuresPtr& box() {
  static const test::StructuresPtr shape = test::boxStructures({0.1, 0.06, 0.04}, 0.002, 0.001);
  return shape;
}

const test::StructuresPtr& floor() {
  static const test::StructuresPtr shape = test::floorStructures(0.6, 0.004);
  return shape;
}

const Pose kHalfMillimetreDeep(Vector3(0.0, 0.0, 0.0195));

std::unique_ptr<PairQueryResult> resultOf(const PairQuery& query) {
  auto result = std::make_unique<PairQueryResult>();
  queryPair(query, *result);
  return result;
}

TEST(LevelOfDetail, AQueryStaysWithinItsBudgetAndReportsSkippedLevels) {
  PairQuery query{&box()->shell, &floor()->field, kHalfMillimetreDeep, Pose(), 0.0005};
  query.reduce = true;
  const auto unlimited = resultOf(query);
  const auto levels = static_cast<std::uint32_t>(box()->shell.levels().size());
  EXPECT_EQ(unlimited->levels_used, levels);
  EXPECT_EQ(unlimited->skipped_gap_error, 0.0);
  std::uint32_t last = levels + 1;
  for (const std::uint32_t budget : {100'000U, 3000U, 800U, 200U, 1U}) {
    query.budget = budget;
    const auto result = resultOf(query);
    EXPECT_LE(result->counts.points_visited, std::max(1.1 * budget, 100.0));
    EXPECT_LE(result->levels_used, last);
    EXPECT_GE(result->levels_used, 1U) << "the coarsest level is always used";
    EXPECT_EQ(result->counts.spheres_total, unlimited->counts.spheres_total);
    if (result->levels_used < levels) {
      EXPECT_EQ(result->skipped_gap_error, box()->shell.levels()[result->levels_used - 1].spacing);
    }
    last = result->levels_used;
  }
  EXPECT_EQ(last, 1U);
}

TEST(LevelOfDetail, PriorityPointsOfSkippedLevelsAreListedWithAreaZero) {
  PairQuery query{&box()->shell, &floor()->field, kHalfMillimetreDeep, Pose(), 0.0005, 2};
  const auto coarse = resultOf(query);
  const structures::ShellLevel& level = box()->shell.levels()[1];
  const std::uint32_t end = level.first_point + level.point_count;
  // 40 points of the underside, and one of the levels in use
  std::vector<std::uint32_t> first;
  const auto points = box()->shell.points();
  for (std::uint32_t i = end; first.size() < 40; ++i) {
    if (points[i].inward_M.z() > 0.99F) first.push_back(i);
  }
  first.push_back(0);
  query.priority_points = first;
  const auto result = resultOf(query);
  EXPECT_EQ(result->contacts.size(), coarse->contacts.size() + 40);
  for (const Contact& contact : result->contacts) {
    const structures::ShellPoint& point = points[contact.point];
    EXPECT_NEAR(contact.gap, point.p_MP.z() + 0.0195, 2e-6);
    EXPECT_EQ(contact.area == 0.0, contact.point >= end);
  }
  const auto force = [](const PairQueryResult& one) {
    return penaltyWrench(one, Vector3::Zero(), kPenaltyStiffness).force.z();
  };
  EXPECT_EQ(force(*result), force(*coarse));
}

}  // namespace
}  // namespace tenon::collision
