#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/bake/bake.h"

namespace tenon::bake {
namespace {

constexpr double kRadius = 0.01;      // [m] of a shaft
constexpr double kHalfLength = 0.02;  // [m]
constexpr int kFacets = 40;
constexpr double kSliver = 3e-6;  // [m] width of a narrow facet

/// A prism from -kHalfLength to kHalfLength along z, of a `section` about the axis, turned by `q`.
TriangleMesh prism(std::vector<Vector3> section, const Quaternion& q) {
  TriangleMesh mesh;
  const auto count = static_cast<std::uint32_t>(section.size());
  section.push_back(Vector3::Zero());
  for (const double z : {-kHalfLength, kHalfLength}) {
    for (const Vector3& p : section) mesh.vertices.push_back((q * (p + Vector3(0.0, 0.0, z))).cast<float>());
  }
  const std::uint32_t upper = count + 1;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t next = (i + 1) % count;
    mesh.triangles.push_back({i, next, upper + next});
    mesh.triangles.push_back({i, upper + next, upper + i});
    mesh.triangles.push_back({count, next, i});
    mesh.triangles.push_back({upper + count, upper + i, upper + next});
  }
  return mesh;
}

/// Of a shaft of kFacets facets and a narrow one between every two, whose vertices are off by `rounded` [m]
/// at most: so the direction of a narrow one is off by up to 25 degrees.
std::vector<Vector3> roundWithSlivers(double rounded) {
  std::mt19937_64 random(13);
  const auto symmetric = [&] {
    return 2.0 * (static_cast<double>(random() >> 11U) / 9007199254740992.0) - 1.0;
  };
  std::vector<Vector3> section;
  for (int k = 0; k < kFacets; ++k) {
    for (const double side : {-0.5, 0.5}) {
      const double angle = 2.0 * std::numbers::pi * k / kFacets + side * kSliver / kRadius;
      const double r = kRadius + rounded * symmetric();
      section.emplace_back(r * std::cos(angle), r * std::sin(angle), 0.0);
    }
  }
  return section;
}

structures::FeatureShell featuresOf(const TriangleMesh& mesh) {
  BakeOptions options;
  options.voxel = 0.001;
  options.points = 2000;
  const auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << (structures ? "" : structures.error().what);
  return structures ? structures->features : structures::FeatureShell();
}

struct Pieces {
  int along = 0;          // of edges along the shaft
  double at_rims = 0.0;   // [m] length of those around its ends
  double farthest = 0.0;  // [m] of those from the rim's plane
};

Pieces piecesOf(const structures::FeatureShell& features, const Quaternion& q) {
  Pieces pieces;
  for (std::size_t i = 0; i < features.edges().size(); ++i) {
    const Vector3 half = q.conjugate() * features.edges()[i].half_M.cast<double>();
    const Vector3 p = q.conjugate() * features.points().points()[i].p_MP.cast<double>();
    if (half.isZero(0.0)) continue;
    const bool is_along = std::abs(half.z()) > 0.5 * half.norm();
    if (is_along) {
      ++pieces.along;
      continue;
    }
    pieces.at_rims += 2.0 * half.norm();
    pieces.farthest = std::max(pieces.farthest, std::abs(std::abs(p.z()) - kHalfLength));
  }
  return pieces;
}

//   \__  a shaft's facets turn by 9 degrees, and a rounded sliver between two of them seems to turn by more:
//      \  it is no edge, in whatever direction the shaft lies
TEST(NarrowFacets, OfARoundSurfaceAreNoEdges) {
  for (const Vector3& turn : {Vector3(0.0, 0.0, 0.0), Vector3(0.4, 1.1, -0.3), Vector3(-2.0, 0.2, 1.0)}) {
    const Quaternion q = expRotation(turn);
    const structures::FeatureShell features = featuresOf(prism(roundWithSlivers(0.7e-6), q));
    const Pieces pieces = piecesOf(features, q);
    EXPECT_EQ(pieces.along, 0);
    const double rim = 2.0 * kRadius * kFacets * std::sin(std::numbers::pi / kFacets);  // [m]
    EXPECT_NEAR(pieces.at_rims, 2.0 * rim, 0.01 * rim) << "each facet has an edge at either end";
    EXPECT_LT(pieces.farthest, 1e-6);
  }
}

//    __
//   /  \   the edges of a box with chamfers of 3 um are edges
//   |  |
TEST(NarrowFacets, OfAnEdgeLeaveItAnEdge) {
  constexpr double kHalf = 0.01;  // [m]
  std::vector<Vector3> section;   // around z, of the box and its four chamfers
  for (const Vector3& corner :
       {Vector3(1.0, 1.0, 0.0), Vector3(-1.0, 1.0, 0.0), Vector3(-1.0, -1.0, 0.0), Vector3(1.0, -1.0, 0.0)}) {
    const Vector3 across(-corner.y(), corner.x(), 0.0);
    for (const double side : {-0.5, 0.5})
      section.push_back(kHalf * corner + 0.5 * kSliver * (2.0 * side * across - corner));
  }
  const structures::FeatureShell features = featuresOf(prism(section, Quaternion::Identity()));
  std::array<double, 4> length{};  // [m] of the pieces along each edge
  for (std::size_t i = 0; i < features.edges().size(); ++i) {
    const Vector3f& half = features.edges()[i].half_M;
    const Vector3f& p = features.points().points()[i].p_MP;
    if (std::abs(half.z()) < 0.5F * half.norm() || half.isZero(0.0F)) continue;
    length[(p.x() > 0.0F ? 0U : 1U) + (p.y() > 0.0F ? 0U : 2U)] += 2.0 * half.cast<double>().norm();
  }
  for (const double one : length) EXPECT_GE(one, 2.0 * kHalfLength - 1e-5);
}

}  // namespace
}  // namespace tenon::bake
