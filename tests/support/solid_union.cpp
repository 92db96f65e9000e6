#include "tests/support/solid_union.h"

#include <cstdint>

namespace tenon::test {

namespace {

/// [m] Longest edge of the pieces that triangles are cut into: where all corners are on one side of the other
/// solids, and where they are not.
constexpr double kMaxUniformEdge = 0.008;
constexpr double kMaxMixedEdge = 0.00025;

Eigen::AlignedBox3d boxOf(const std::vector<SolidUnion::Triangle>& triangles) {
  Eigen::AlignedBox3d box;
  for (const auto& corners : triangles) {
    for (const Vector3& corner : corners) box.extend(corner);
  }
  return box;
}

ExactDistance exactOf(const std::vector<SolidUnion::Triangle>& triangles) {
  std::vector<Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangle_indices;
  for (const auto& corners : triangles) {
    const auto first = static_cast<std::uint32_t>(vertices.size());
    for (const Vector3& corner : corners) vertices.push_back(corner.cast<float>());
    triangle_indices.push_back({first, first + 1, first + 2});
  }
  return {vertices, triangle_indices};
}

}  // namespace

SolidUnion::SolidUnion(std::vector<Solid> solids) {
  for (const Solid& solid : solids) {
    solids_.push_back({boxOf(solid.triangles), solid.closed, exactOf(solid.triangles)});
  }
  for (std::size_t i = 0; i < solids.size(); ++i) {
    for (const Triangle& triangle : solids[i].triangles) addOuterPieces(triangle, i);
  }
  surface_ = exactOf(outer_);
}

bool SolidUnion::insideAnother(const Vector3& p_MP, std::size_t excluded) const {
  for (std::size_t i = 0; i < solids_.size(); ++i) {
    const Bounded& solid = solids_[i];
    if (i != excluded && solid.closed && solid.box.contains(p_MP) && solid.exact.behindNearest(p_MP))
      return true;
  }
  return false;
}

/// Bisects a triangle until it is entirely inside or outside the others, or small.
void SolidUnion::addOuterPieces(const Triangle& t, std::size_t solid) {
  const Vector3 cross = (t[1] - t[0]).cross(t[2] - t[0]);
  if (!(cross.norm() > 0.0)) return;
  Eigen::AlignedBox3d box;
  for (const Vector3& corner : t) box.extend(corner);
  bool isolated = true;
  for (std::size_t i = 0; i < solids_.size() && isolated; ++i) {
    isolated = i == solid || !solids_[i].closed || !solids_[i].box.intersects(box);
  }
  if (isolated) {
    outer_.push_back(t);
    return;
  }
  // 1 um off the face, so that coinciding faces count as inner
  const Vector3 middle = (t[0] + t[1] + t[2]) / 3.0 + 1e-6 * cross.normalized();
  int corners_inside = insideAnother(middle, solid) ? 1 : 0;
  for (const Vector3& corner : t)
    corners_inside += insideAnother(middle + 0.98 * (corner - middle), solid) ? 1 : 0;
  std::size_t longest = 0;
  const auto edge = [&t](std::size_t i) { return (t[(i + 1) % 3] - t[i]).norm(); };
  for (std::size_t i = 1; i < 3; ++i) longest = edge(i) > edge(longest) ? i : longest;
  if (edge(longest) < (corners_inside % 4 == 0 ? kMaxUniformEdge : kMaxMixedEdge)) {
    if (corners_inside < 2) outer_.push_back(t);
    return;
  }
  const Vector3& a = t[longest];
  const Vector3& b = t[(longest + 1) % 3];
  const Vector3& c = t[(longest + 2) % 3];
  const Vector3 half = 0.5 * (a + b);
  addOuterPieces({a, half, c}, solid);
  addOuterPieces({half, b, c}, solid);
}

}  // namespace tenon::test
