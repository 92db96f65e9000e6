#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/session/two_parts.h"

namespace tenon::session {
namespace {

constexpr double kHalfEdge = 0.0070710678;  // [m] of a bar from its axis to its edge
constexpr double kMostOverlap = 2e-4;       // [m] issued for crossed edges

struct Box {
  Pose X_WB;
  Vector3 half;
};

/// [m] By how much two boxes overlap along the axis that separates them best; negative: they do not.
double overlapOf(const Box& a, const Box& b) {
  const Matrix3 R_a = a.X_WB.matrix();
  const Matrix3 R_b = b.X_WB.matrix();
  const Vector3 apart = b.X_WB.translation() - a.X_WB.translation();
  double least = std::numeric_limits<double>::infinity();
  const auto along = [&](const Vector3& axis) {
    if (axis.norm() < 1e-3) return;
    const Vector3 n = axis.normalized();
    const double reach =
        (R_a.transpose() * n).cwiseAbs().dot(a.half) + (R_b.transpose() * n).cwiseAbs().dot(b.half);
    least = std::min(least, reach - std::abs(apart.dot(n)));
  };
  for (int i = 0; i < 3; ++i) {
    along(R_a.col(i));
    along(R_b.col(i));
    for (int j = 0; j < 3; ++j) along(R_a.col(i).cross(R_b.col(j)));
  }
  return least;
}

struct SlideCase {
  const char* name;
  double voxel_mm;
  bool off_held;  ///< off the end of the held bar, else of the fixed one
};
void PrintTo(const SlideCase& one, std::ostream* out) { *out << one.name; }

//   <>  ->   a bar in a hand, an edge down, pressed on another's edge, slides off an end and comes back
//  =====
class SlidingEdges : public test::TwoParts, public ::testing::WithParamInterface<SlideCase> {
 protected:
  /// [m] Largest overlap on a way that `seed` chooses.
  static double slide(const std::shared_ptr<const simulation::Scene>& scene, unsigned seed) {
    std::mt19937 random(seed);
    const auto within = [&random](double most) { return most * (2.0 * (random() / 4294967296.0) - 1.0); };
    const Quaternion q = expRotation({0.0, 0.0, within(0.9)}) * expRotation({0.0, within(0.2), 0.0}) *
                         expRotation({within(0.4), 0.0, 0.0});
    const Vector3 start(within(0.01), within(0.01), 0.0);
    const double speed = std::array{0.1, 0.3, 1.0}[seed % 3];
    Vector3 off = GetParam().off_held ? Vector3(q * Vector3::UnitX()) : Vector3::UnitY();
    off = (off - Vector3(0.0, 0.0, off.z())).normalized() * (GetParam().off_held ? 0.05 : 0.08) *
          (random() % 2 == 0 ? 1.0 : -1.0);
    const Vector3 above(0.0, 0.0, 2.0 * kHalfEdge + 0.004);
    const Vector3 pressed(0.0, 0.0, 2.0 * kHalfEdge - 0.01);

    simulation::Environment environment(scene, {});
    const HandId hand{0};
    environment.setHandPresent(hand, true);
    double most = -1.0;
    Vector3 at = start + above;
    const auto go = [&](const Vector3& to, double seconds) {
      const int ticks = static_cast<int>(std::lround(1e3 * seconds));
      for (int tick = 1; tick <= ticks; ++tick) {
        environment.setHandPose(hand, Pose(at + (to - at) * tick / ticks, q), {});
        environment.step();
        const Pose X_WO = environment.objects()[1].X_WO;
        const Box fixed{Pose(Vector3::Zero(), expRotation({0.0, std::numbers::pi / 4.0, 0.0})),
                        {0.005, 0.06, 0.005}};
        const Box held{X_WO * Pose(Vector3::Zero(), expRotation({std::numbers::pi / 4.0, 0.0, 0.0})),
                       {0.03, 0.005, 0.005}};
        most = std::max(most, overlapOf(fixed, held));
      }
      at = to;
    };
    go(start + pressed, 0.15);
    go(start + off + pressed, off.norm() / speed);
    go(start + off + pressed, 0.1);
    go(start + pressed, off.norm() / speed);
    return most;
  }
};

TEST_P(SlidingEdges, DoNotOverlapAtTheirEnds) {
  const auto scene = load("{box: [10 mm, 120 mm, 10 mm], turn: {axis: y, deg: 45}}",
                          "{box: [60 mm, 10 mm, 10 mm], turn: {axis: x, deg: 45}}", GetParam().voxel_mm);
  ASSERT_TRUE(scene);
  double most = -1.0;
  double without = -1.0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    most = std::max(most, slide(scene, seed));
    if (seed < 3) without = std::max(without, slide(withoutFeatures(*scene), seed));
  }
  EXPECT_LE(most, kMostOverlap);
  EXPECT_GE(most, -1e-4) << "they do not meet";
  EXPECT_GT(without, 2.0 * kMostOverlap) << "the field alone is as good: nothing is tested here";
  RecordProperty("overlap_um", static_cast<int>(std::lround(1e6 * most)));
}

INSTANTIATE_TEST_SUITE_P(Bars, SlidingEdges,
                         ::testing::Values(SlideCase{"OffTheHeldAt1mm", 1.0, true},
                                           SlideCase{"OffTheHeldAt3mm", 3.0, true},
                                           SlideCase{"OffTheFixedAt2mm", 2.0, false},
                                           SlideCase{"OffTheFixedAt3mm", 3.0, false}),
                         [](const auto& one) { return std::string(one.param.name); });

//   [==]       a block that lies flat on a table glides about the table's corner: no edge's end holds it
//  =======
class FlatOnATable : public test::TwoParts, public ::testing::WithParamInterface<double> {};

TEST_P(FlatOnATable, ItsCornerIsFreeAboveTheEndsOfEdges) {
  const auto scene =
      load("{box: [60 mm, 60 mm, 20 mm], at: [0, 0, -10 mm]}", "{box: [30 mm, 20 mm, 20 mm]}", GetParam());
  ASSERT_TRUE(scene);
  const Vector3 corner(0.015, 0.01, 0.0);  // of the block, from its centre
  simulation::Environment environment(scene, {});
  environment.setHandPresent(HandId{0}, true);
  double most = 0.0;  // [m] to the side of the hand
  std::mt19937 random(4);
  const auto inside = [&random] { return 0.03 - 0.0005 - 0.0025 * (random() / 4294967296.0); };
  Vector3 at(inside(), inside(), 0.012);
  for (int leg = 0; leg < 12; ++leg) {
    const Vector3 to(inside(), inside(), 0.007);  // 3 N
    const int ticks = std::max(30, static_cast<int>(1e3 * (to - at).norm() / 0.05));
    for (int tick = 1; tick <= ticks; ++tick) {
      const Vector3 p_WH = at + (to - at) * tick / ticks - corner;
      environment.setHandPose(HandId{0}, Pose(p_WH), {});
      environment.step();
      most = std::max(most, (environment.objects()[1].X_WO.translation() - p_WH).head<2>().norm());
    }
    at = to;
  }
  EXPECT_GT(environment.objects()[1].X_WO.translation().z(), 0.0095) << "it lies on the table";
  EXPECT_LT(most, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Voxels, FlatOnATable, ::testing::Values(1.0, 2.0, 3.0));

}  // namespace
}  // namespace tenon::session
