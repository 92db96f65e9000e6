#include "tests/support/solid_union.h"

#include <cstdint>

namespace tenon::test {

namespace {

/// [m] Edges of the pieces that triangles are cut into: where all corners agree, and where they do not.
constexpr double kWhole = 0.008;
constexpr double kMixed = 0.00025;

Eigen::AlignedBox3d boxOf(const std::vector<SolidUnion::Triangle>& triangles) {
  Eigen::AlignedBox3d box;
  for (const auto& corners : triangles) {
    for (const Vector3& corner : corners) box.extend(corner);
  }
  return box;
}

ExactDistance exactOf(const std::vector<SolidUnion::Triangle>& triangles) {
  std::vector<Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> numbers;
  for (const auto& corners : triangles) {
    const auto first = static_cast<std::uint32_t>(vertices.size());
    for (const Vector3& corner : corners) vertices.push_back(corner.cast<float>());
    numbers.push_back({first, first + 1, first + 2});
  }
  return {vertices, numbers};
}

}  // namespace

SolidUnion::SolidUnion(std::vector<Solid> solids) {
  for (const Solid& solid : solids) {
    solids_.push_back({boxOf(solid.triangles), solid.closed, exactOf(solid.triangles)});
  }
  for (std::size_t i = 0; i < solids.size(); ++i) {
    for (const Triangle& triangle : solids[i].triangles) keepOuter(triangle, i);
  }
  surface_ = exactOf(outer_);
}

bool SolidUnion::insideAnother(const Vector3& p_MP, std::size_t but) const {
  for (std::size_t i = 0; i < solids_.size(); ++i) {
    const Bounded& solid = solids_[i];
    if (i != but && solid.closed && solid.box.contains(p_MP) && solid.exact.behindNearest(p_MP)) return true;
  }
  return false;
}

/// Halves a triangle until it is wholly in or out of the others, or small.
void SolidUnion::keepOuter(const Triangle& t, std::size_t solid) {
  const Vector3 cross = (t[1] - t[0]).cross(t[2] - t[0]);
  if (!(cross.norm() > 0.0)) return;
  Eigen::AlignedBox3d box;
  for (const Vector3& corner : t) box.extend(corner);
  bool alone = true;
  for (std::size_t i = 0; i < solids_.size() && alone; ++i) {
    alone = i == solid || !solids_[i].closed || !solids_[i].box.intersects(box);
  }
  if (alone) {
    outer_.push_back(t);
    return;
  }
  // a little off the face, so that faces on each other count as inner
  const Vector3 middle = (t[0] + t[1] + t[2]) / 3.0 + 1e-6 * cross.normalized();
  int within = insideAnother(middle, solid) ? 1 : 0;
  for (const Vector3& corner : t) within += insideAnother(middle + 0.98 * (corner - middle), solid) ? 1 : 0;
  std::size_t longest = 0;
  const auto edge = [&t](std::size_t i) { return (t[(i + 1) % 3] - t[i]).norm(); };
  for (std::size_t i = 1; i < 3; ++i) longest = edge(i) > edge(longest) ? i : longest;
  if (edge(longest) < (within % 4 == 0 ? kWhole : kMixed)) {
    if (within < 2) outer_.push_back(t);
    return;
  }
  const Vector3& a = t[longest];
  const Vector3& b = t[(longest + 1) % 3];
  const Vector3& c = t[(longest + 2) % 3];
  const Vector3 half = 0.5 * (a + b);
  keepOuter({a, half, c}, solid);
  keepOuter({half, b, c}, solid);
}

}  // namespace tenon::test
