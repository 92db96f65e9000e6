#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "server/collision/valley_correction.h"
#include "server/structures/field_builder.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/exact_distance.h"

namespace tenon::collision {
namespace {

constexpr double kPocketVoxel = 0.001;  // [m]

void addQuad(bake::TriangleMesh& mesh, const Vector3& a, const Vector3& b, const Vector3& c,
             const Vector3& d) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Vector3& corner : {a, b, c, d}) mesh.vertices.push_back(corner.cast<float>());
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

/// A block with a pocket down from z = 0 whose outline has `sides` [-], is 24 mm wide on top and narrows by
/// 2.5 degrees: its walls, its floor and the edges between them are concave.
bake::TriangleMesh pocket(int sides, const Quaternion& q) {
  constexpr double kSlope = 0.04366;                  // [-] tan 2.5 degrees
  constexpr double kFloor = -0.012, kBottom = -0.02;  // [m]
  const auto corner = [sides](int k, double radius, double z) {
    const double angle = 2.0 * std::numbers::pi * (k + 0.5) / sides;
    return Vector3(radius * std::cos(angle), radius * std::sin(angle), z);
  };
  bake::TriangleMesh mesh;
  const double top = 0.012 / std::cos(std::numbers::pi / sides);
  const double floor = top + kSlope * kFloor;
  const double outer = top + 0.008;
  for (int k = 0; k < sides; ++k) {
    const auto quad = [&](double radius_a, double z_a, double radius_b, double z_b) {
      addQuad(mesh, corner(k, radius_a, z_a), corner(k + 1, radius_a, z_a), corner(k + 1, radius_b, z_b),
              corner(k, radius_b, z_b));
    };
    quad(outer, kBottom, outer, 0.0);
    quad(outer, 0.0, top, 0.0);
    quad(top, 0.0, floor, kFloor);
    quad(floor, kFloor, 0.0, kFloor);
    quad(0.0, kBottom, outer, kBottom);
  }
  for (Vector3f& p : mesh.vertices) p = (q * p.cast<double>()).cast<float>();
  return mesh;
}

structures::DistanceField withoutPlanes(const std::shared_ptr<const structures::HapticStructures>& shape) {
  structures::DistanceField::Layout layout = shape->field.layout();
  layout.valley_index = {};
  return {layout, shape};
}

/// Errors of distances [voxels] at random points near the surface, within a voxel of a concave edge.
struct PocketErrors {
  double worst = 0.0;         ///< of all
  double worst_before = 0.0;  ///< without planes
  int wrong = 0;              ///< points with an error above 0.02
  int wrong_before = 0;
  int points = 0;
};

class ValleyPlanes : public ::testing::TestWithParam<int> {};

//  \        /   a pocket, turned in the grid
//   \______/
TEST_P(ValleyPlanes, GiveTheDistanceToTheMeshAtConcaveEdgesInAnyOrientation) {
  const int sides = GetParam();
  test::SeededRandom random(5);
  PocketErrors errors;
  for (int turn = 0; turn < 12; ++turn) {
    const Quaternion q = turn == 0 ? Quaternion::Identity() : expRotation(1.5 * random.vector());
    const bake::TriangleMesh mesh = pocket(sides, q);
    const auto shape = test::baked(mesh, kPocketVoxel, 500);
    ASSERT_TRUE(shape->field.hasPlanes());
    const structures::DistanceField without = withoutPlanes(shape);
    const test::ExactDistance truth(mesh.vertices, mesh.triangles);
    const double bottom = (0.012 / std::cos(std::numbers::pi / sides)) - 0.04366 * 0.012;
    for (int i = 0; i < 4000; ++i) {
      // along the edges of the floor and those between the walls, not at the convex rim
      const int k = static_cast<int>(random.index(static_cast<std::size_t>(sides)));
      const auto at = [&](int number) {
        const double angle = 2.0 * std::numbers::pi * (number + 0.5) / sides;
        return Vector3(bottom * std::cos(angle), bottom * std::sin(angle), -0.012);
      };
      const double along = 0.5 * random.symmetric() + 0.5;
      Vector3 p =
          i % 2 == 0
              ? Vector3(at(k) + along * (at(k + 1) - at(k)))
              : Vector3(at(k) + along * 0.009 *
                                    Vector3(0.0436 * at(k).x() / bottom, 0.0436 * at(k).y() / bottom, 1.0));
      p = q * Vector3(p + 0.8 * kPocketVoxel * random.vector());
      const auto nearest = truth.nearest(p);
      if (nearest.distance > 0.4 * kPocketVoxel) continue;
      const double exact = truth.inside(p) ? -nearest.distance : nearest.distance;
      // a point behind two planes has the distance to one of them
      if (exact < -0.02 * kPocketVoxel) continue;
      const double error = std::abs(sampleInValley(shape->field, p).distance - exact) / kPocketVoxel;
      const double before = std::abs(sampleInValley(without, p).distance - exact) / kPocketVoxel;
      ++errors.points;
      errors.worst = std::max(errors.worst, error);
      errors.worst_before = std::max(errors.worst_before, before);
      errors.wrong += error > 0.02 ? 1 : 0;
      errors.wrong_before += before > 0.02 ? 1 : 0;
    }
  }
  EXPECT_GT(errors.points, 5000);
  // the rest: cells whose samples have the wrong sign, see findOutside()
  EXPECT_LE(errors.wrong, errors.points / 60) << "worst " << errors.worst << " voxels";
  EXPECT_GT(errors.wrong_before, 5 * errors.wrong + errors.points / 100) << "planes are not needed here";
  RecordProperty("worst_thousandths", static_cast<int>(1e3 * errors.worst));
  RecordProperty("worst_before_thousandths", static_cast<int>(1e3 * errors.worst_before));
  RecordProperty("wrong", errors.wrong);
  RecordProperty("wrong_before", errors.wrong_before);
  RecordProperty("points", errors.points);
}

INSTANTIATE_TEST_SUITE_P(Sides, ValleyPlanes, ::testing::Values(4, 5, 24));

//   |#|      a rib of a fifth of a voxel stands in a corner
//  _|#|___
TEST(ValleyPlanesOfARib, DoNotOpenIt) {
  test::SeededRandom random(3);
  for (int turn = 0; turn < 6; ++turn) {
    const Quaternion q = expRotation(1.5 * random.vector());
    bake::TriangleMesh mesh = test::together(test::boxMesh({-0.01, -0.01, -0.006}, {0.01, 0.01, 0.0}),
                                             test::boxMesh({-0.0001, -0.01, -0.001}, {0.0001, 0.01, 0.006}));
    for (Vector3f& p : mesh.vertices) p = (q * p.cast<double>()).cast<float>();
    const auto shape = test::baked(mesh, kPocketVoxel, 500);
    const structures::DistanceField without = withoutPlanes(shape);
    for (int i = 0; i < 4000; ++i) {
      const Vector3 in_rib(0.0001 * random.symmetric(), 0.009 * random.symmetric(),
                           0.0025 + 0.0025 * random.symmetric());
      const Vector3 p = q * in_rib;
      EXPECT_LE(sampleInValley(shape->field, p).distance, std::max(sampleInValley(without, p).distance, 0.0))
          << in_rib.transpose();
    }
  }
}

}  // namespace
}  // namespace tenon::collision
