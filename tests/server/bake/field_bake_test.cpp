#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/exact_distance.h"
#include "tests/support/test_meshes.h"

namespace tenon::bake {
namespace {

using test::ballMesh;
using test::boxMesh;
using test::ExactDistance;

structures::HapticStructures baked(const TriangleMesh& mesh, double voxel = 0.003,
                                   std::vector<RefineBox> refine = {}) {
  BakeOptions options;
  options.voxel = voxel;
  options.points = 2000;
  options.refine = std::move(refine);
  auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << structures.error().what;
  return structures.value_or(structures::HapticStructures{});
}

/// Random points in a box, with a fixed seed.
std::vector<Vector3> randomPointsIn(const Eigen::AlignedBox3d& box, int count, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::vector<Vector3> points;
  for (int i = 0; i < count; ++i) {
    Vector3 p;
    for (int axis = 0; axis < 3; ++axis) {
      const double u = static_cast<double>(random() >> 11U) * 0x1p-53;
      p[axis] = box.min()[axis] + u * box.sizes()[axis];
    }
    points.push_back(p);
  }
  return points;
}

double quantile(std::vector<double> values, double fraction) {
  EXPECT_FALSE(values.empty());
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
}

bool sameBytes(const structures::HapticStructures& a, const structures::HapticStructures& b) {
  const auto equal = [](const auto& x, const auto& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end());
  };
  const auto& fa = a.field.layout();
  const auto& fb = b.field.layout();
  const auto same_point = [](const structures::ShellPoint& x, const structures::ShellPoint& y) {
    return x.p_MP == y.p_MP && x.inward_M == y.inward_M && x.area == y.area;
  };
  return equal(fa.index, fb.index) && equal(fa.samples, fb.samples) && equal(fa.far, fb.far) &&
         std::equal(a.shell.points().begin(), a.shell.points().end(), b.shell.points().begin(),
                    b.shell.points().end(), same_point);
}

TEST(FieldBake, AgreesWithTheExactDistanceToATorusOnBothSides) {
  const TriangleMesh mesh = test::torusMesh(0.06, 0.02, 96, 48);
  const test::ExactDistance truth(mesh.vertices, mesh.triangles);
  const structures::HapticStructures structures = baked(mesh);
  std::vector<double> errors;
  int wrong_signs = 0;
  for (const Vector3& p : randomPointsIn({Vector3(-0.09, -0.09, -0.03), Vector3(0.09, 0.09, 0.03)}, 20'000)) {
    const structures::FieldSample sample = structures.field.sample(p);
    if (!sample.exact) continue;
    const double exact = truth.nearest(p).distance;
    errors.push_back(std::abs(std::abs(sample.distance) - exact));
    const double ring = Vector3(std::hypot(p.x(), p.y()) - 0.06, 0.0, p.z()).norm() - 0.02;
    if (std::abs(ring) > 0.0015 && (ring < 0.0) != (sample.distance < 0.0)) ++wrong_signs;
  }
  EXPECT_GT(errors.size(), 3000U);
  // the error of trilinear interpolation on a surface of curvature 1 / radius is voxel^2 / (8 radius)
  EXPECT_LT(quantile(errors, 0.5), 0.02 * 0.003);
  EXPECT_LT(quantile(errors, 0.99), 0.1 * 0.003);
  EXPECT_EQ(wrong_signs, 0);
}

TEST(FieldBake, FlippingHalfOfAllTrianglesChangesNoByte) {
  for (const TriangleMesh& mesh :
       {test::ballMesh(0.05, 4), test::boxMesh(Vector3(-0.05, -0.03, 0.0), Vector3(0.05, 0.03, 0.04)),
        test::torusMesh(0.06, 0.02, 60, 30)}) {
    const structures::HapticStructures plain = baked(mesh);
    EXPECT_TRUE(sameBytes(plain, baked(test::randomlyFlipped(mesh, 7))));
  }
}

TEST(FieldBake, ASolidWithOnePercentOfTrianglesMissingStaysSolid) {
  TriangleMesh mesh = test::ballMesh(0.05, 5);
  for (std::size_t i = mesh.triangles.size(); i-- > 0;) {
    if (i % 100 == 37) mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const structures::HapticStructures structures = baked(mesh);
  int wrong = 0;
  int all = 0;
  for (const Vector3& p : randomPointsIn({Vector3::Constant(-0.06), Vector3::Constant(0.06)}, 20'000)) {
    const double exact = p.norm() - 0.05;
    if (std::abs(exact) < 0.0015 || std::abs(exact) > 0.012) continue;
    ++all;
    if ((structures.field.sample(p).distance < 0.0) != (exact < 0.0)) ++wrong;
  }
  EXPECT_LT(wrong, all * 0.025);
}

//    +-------+
//    |   +---|---+     walls inside the union are not part of its surface: between them
//    |   | x |   |     the nearest surface is the outer one
//    +---|---+   |
//        +-------+
TEST(FieldBake, WallsInsideAUnionDoNotReduceDepths) {
  const Vector3 a_from(0.0, 0.0, 0.0);
  const Vector3 a_to(0.08, 0.08, 0.08);
  const Vector3 b_from(0.05, 0.03, 0.0);
  const Vector3 b_to(0.13, 0.11, 0.08);
  const structures::HapticStructures structures =
      baked(test::together(test::boxMesh(a_from, a_to), test::boxMesh(b_from, b_to)), 0.002);
  const auto boxDepth = [](const Vector3& p, const Vector3& from, const Vector3& to) {
    return std::min((p - from).minCoeff(), (to - p).minCoeff());
  };
  std::vector<double> errors;
  for (const Vector3& p : randomPointsIn({Vector3(0.0, 0.0, 0.0), Vector3(0.13, 0.11, 0.08)}, 60'000)) {
    // in one box, near its wall that the other box hides, away from every visible wall
    const double depth = std::max(boxDepth(p, a_from, a_to), boxDepth(p, b_from, b_to));
    const double hidden_a = a_to.x() - p.x();
    const double hidden_b = p.x() - b_from.x();
    const bool near_hidden = std::abs(hidden_a) < 0.004 || std::abs(hidden_b) < 0.004;
    if (depth < 0.005 || !near_hidden || p.y() < 0.04 || p.y() > 0.07) continue;
    const double to_surface = std::min({p.z(), 0.08 - p.z(), 0.08 - p.y() + 0.004, p.y() - 0.03 + 0.004});
    if (to_surface < 0.003) continue;
    const structures::FieldSample sample = structures.field.sample(p);
    EXPECT_LT(sample.distance, -0.002) << p.transpose();
    errors.push_back(sample.distance);
  }
  EXPECT_GT(errors.size(), 500U);
}

TEST(FieldBake, OutsideOfAUnionIsExact) {
  const TriangleMesh mesh =
      test::together(test::boxMesh(Vector3(0.0, 0.0, 0.0), Vector3(0.08, 0.08, 0.08)),
                     test::boxMesh(Vector3(0.05, 0.03, 0.01), Vector3(0.13, 0.11, 0.07)));
  const test::ExactDistance truth(mesh.vertices, mesh.triangles);
  const structures::HapticStructures structures = baked(mesh, 0.002);
  std::vector<double> errors;
  for (const Vector3& p : randomPointsIn({Vector3::Constant(-0.01), Vector3(0.14, 0.12, 0.09)}, 20'000)) {
    const structures::FieldSample sample = structures.field.sample(p);
    if (sample.exact && sample.distance > 0.0) {
      errors.push_back(std::abs(sample.distance - truth.nearest(p).distance));
    }
  }
  EXPECT_LT(quantile(errors, 0.5), 0.01 * 0.002);
  EXPECT_LT(quantile(errors, 0.99), 0.25 * 0.002);
}

TEST(FieldBake, BothSidesOfASheetAreOutside) {
  const structures::HapticStructures structures = baked(test::sheetMesh(0.05, 0.0011, 10));
  for (const Vector3& p : randomPointsIn({Vector3(-0.06, -0.06, -0.01), Vector3(0.06, 0.06, 0.01)}, 5'000)) {
    EXPECT_GE(structures.field.undilated(p).distance, -2e-6) << "but for rounding";
  }
  EXPECT_NE(structures.info.notes.find("1 of 1 connected parts have no inside"), std::string::npos)
      << structures.info.notes;
}

TEST(FieldBake, BothSidesOfAnOpenBoxAreOutside) {
  TriangleMesh mesh = test::boxMesh(Vector3::Constant(-0.05), Vector3::Constant(0.05));
  mesh.triangles.erase(mesh.triangles.begin() + 2, mesh.triangles.begin() + 4);  // its lid
  const structures::HapticStructures structures = baked(mesh);
  EXPECT_GT(structures.field.undilated(Vector3(0.0, 0.0, -0.045)).distance, 0.004);
  EXPECT_GT(structures.field.undilated(Vector3(0.0, 0.0, -0.055)).distance, 0.004);
}

TEST(FieldBake, ACavityIsSolid) {
  const structures::HapticStructures structures = baked(test::together(
      test::boxMesh(Vector3::Constant(-0.05), Vector3::Constant(0.05)), test::ballMesh(0.02, 3)));
  EXPECT_LT(structures.field.sample(Vector3::Zero()).distance, 0.0);
  EXPECT_LT(structures.field.sample(Vector3(0.019, 0.0, 0.0)).distance, -0.01);
}

//   ##### 2.8 mm #####     coarse voxels close this slot; refined ones do not
TEST(FieldBake, RefinementOpensASlotThatCoarseVoxelsClose) {
  const TriangleMesh mesh =
      test::together(test::boxMesh(Vector3(-0.05, -0.05, -0.02), Vector3(-0.0014, 0.05, 0.02)),
                     test::boxMesh(Vector3(0.0014, -0.05, -0.02), Vector3(0.05, 0.05, 0.02)));
  const Vector3 in_slot(0.0, 0.0, 0.0013);
  EXPECT_LT(baked(mesh).field.sample(in_slot).distance, 0.0);
  const RefineBox slot{{Vector3(-0.004, -0.06, -0.03), Vector3(0.004, 0.06, 0.03)}};
  const structures::HapticStructures refined = baked(mesh, 0.003, {slot});
  EXPECT_NEAR(refined.field.sample(in_slot).distance, 0.0014, 4e-4);
  EXPECT_NEAR(refined.field.sample(Vector3(-0.003, 0.0, 0.0)).distance, -0.0016, 2e-4);
}

TEST(FieldBake, LowerBoundIsNeverAboveTheExactDistance) {
  const TriangleMesh mesh =
      test::together(test::torusMesh(0.06, 0.02, 60, 30),
                     test::boxMesh(Vector3(0.05, -0.02, -0.01), Vector3(0.15, 0.02, 0.01)));
  const test::ExactDistance truth(mesh.vertices, mesh.triangles);
  const structures::HapticStructures structures = baked(mesh);
  double best = 0.0;
  for (const Vector3& p : randomPointsIn({Vector3::Constant(-0.3), Vector3::Constant(0.3)}, 20'000)) {
    const double bound = structures.field.lowerBound(p);
    const double exact = truth.nearest(p).distance;
    EXPECT_LE(bound, exact + 1e-12) << p.transpose();
    best = std::max(best, bound / exact);
    const structures::FieldSample sample = structures.field.sample(p);
    if (!sample.exact && sample.distance > 0.0) {
      EXPECT_LE(std::abs(sample.distance), exact + 1e-5) << p.transpose();
    }
  }
  EXPECT_GT(best, 0.8);
}

TEST(FieldBake, TrianglesPresentTwiceOrBackToBackChangeNoDistance) {
  const TriangleMesh once = test::torusMesh(0.06, 0.02, 60, 30);
  TriangleMesh twice = test::together(once, test::randomlyFlipped(once, 3));
  EXPECT_TRUE(sameBytes(baked(once), baked(twice)));
}

TEST(FieldBake, EverySampleIsTheDistanceToTheNearestTriangle) {
  // long slivers and tiny facets together: the worst case of the bounding-box hierarchy
  const TriangleMesh mesh =
      test::together(test::torusMesh(0.06, 0.02, 200, 8),
                     test::boxMesh(Vector3(-0.4, 0.1, 0.02), Vector3(0.4, 0.109, 0.021)));
  const test::ExactDistance truth(mesh.vertices, mesh.triangles);
  const structures::HapticStructures structures = baked(mesh, 0.004);
  const structures::DistanceField::Layout& layout = structures.field.layout();
  const double quantum = layout.voxel / structures::DistanceField::kQuantaPerVoxel;
  std::size_t number = 0;
  std::size_t compared = 0;
  for (int z = 0; z < layout.bricks[2]; ++z) {
    for (int y = 0; y < layout.bricks[1]; ++y) {
      for (int x = 0; x < layout.bricks[0]; ++x, ++number) {
        if (layout.index[number] < 0) continue;
        const std::int16_t* samples = layout.samples.data() + static_cast<std::size_t>(layout.index[number]) *
                                                                  structures::DistanceField::kBrickSamples;
        for (int k = 0; k < structures::DistanceField::kBrickSamples; k += 7) {
          const Vector3 in_brick(k % 9, k / 9 % 9, k / 81);
          const Vector3 p = layout.p_MoFo_M + (Vector3(x, y, z) * 8.0 + in_brick) * layout.voxel;
          const double exact =
              std::min(truth.nearest(p).distance, structures::DistanceField::kClampVoxels * layout.voxel);
          // the sliver is thin: its dilation is in the samples, rounded with them
          const double distance = samples[k] * quantum + structures.field.dilationAt(p);
          ASSERT_NEAR(std::abs(distance), exact, 1.02 * quantum) << p.transpose();
          ++compared;
        }
      }
    }
  }
  EXPECT_GT(compared, 10'000U);
}

TEST(FieldBake, StopsWhenTheProgressCallbackReturnsFalse) {
  const auto structures =
      bake(test::ballMesh(0.05, 4), {}, [](double fraction, std::string_view) { return fraction < 0.3; });
  ASSERT_FALSE(structures);
  EXPECT_EQ(structures.error().what, "cancelled");
}

TEST(FieldBake, RefusesVoxelsThatWouldNeedATerabyte) {
  BakeOptions options;
  options.voxel = 1e-6;
  const auto structures = bake(test::ballMesh(1.0, 3), options);
  ASSERT_FALSE(structures);
  EXPECT_NE(structures.error().what.find("TB"), std::string::npos) << structures.error().what;
}

TEST(FieldBake, RefusesEmptyAndInvalidMeshes) {
  EXPECT_FALSE(bake({}, {}));
  TriangleMesh line;
  line.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  line.triangles = {{0, 1, 2}};
  EXPECT_FALSE(bake(line, {}));
  line.triangles = {{0, 1, 7}};
  EXPECT_FALSE(bake(line, {}));
}

}  // namespace
}  // namespace tenon::bake
