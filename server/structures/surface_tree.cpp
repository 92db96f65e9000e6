#include "server/structures/surface_tree.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tenon::structures {

namespace {

constexpr std::uint32_t kLeafTriangles = 4;
/// Depth of a tree of 2^32 triangles, rounded up: the search stack holds one sibling per level.
constexpr std::size_t kMaxLevels = 40;

/// The point of a triangle nearest to p: on its face, an edge or a corner.
Vector3 nearestOnTriangle(const Vector3& p, const SurfaceTree::Triangle& triangle) {
  const Vector3 a = triangle[0].cast<double>();
  const Vector3 ab = triangle[1].cast<double>() - a;
  const Vector3 ac = triangle[2].cast<double>() - a;
  const Vector3 ap = p - a;
  const double bb = ab.dot(ab);
  const double bc = ab.dot(ac);
  const double cc = ac.dot(ac);
  const double pb = ab.dot(ap);
  const double pc = ac.dot(ap);
  const double determinant = bb * cc - bc * bc;
  // the projection onto the plane, as a + (v ab + w ac) / determinant
  const double v = cc * pb - bc * pc;
  const double w = bb * pc - bc * pb;
  if (determinant > 0.0 && v >= 0.0 && w >= 0.0 && v + w <= determinant) {
    return a + (v / determinant) * ab + (w / determinant) * ac;
  }
  const auto onEdge = [&p](const Vector3& from, const Vector3& along) -> Vector3 {
    const double squared = along.squaredNorm();
    const double fraction = squared > 0.0 ? std::clamp(along.dot(p - from) / squared, 0.0, 1.0) : 0.0;
    return from + fraction * along;
  };
  Vector3 best = onEdge(a, ab);
  for (const Vector3& other : {onEdge(a, ac), onEdge(a + ab, ac - ab)}) {
    if ((other - p).squaredNorm() < (best - p).squaredNorm()) best = other;
  }
  return best;
}

}  // namespace

SurfaceTree::SurfaceTree(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
  if (!triangles_.empty()) build(0, static_cast<std::uint32_t>(triangles_.size()));
}

void SurfaceTree::build(std::uint32_t first, std::uint32_t count) {
  const std::size_t number = nodes_.size();
  nodes_.emplace_back();
  Eigen::AlignedBox3f box;
  for (std::uint32_t i = first; i < first + count; ++i) {
    for (const Vector3f& corner : triangles_[i]) box.extend(corner);
  }
  nodes_[number].low = box.min();
  nodes_[number].high = box.max();
  if (count <= kLeafTriangles) {
    nodes_[number].first = first;
    nodes_[number].count = count;
    return;
  }
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const auto begin = triangles_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [axis](const Triangle& a, const Triangle& b) {
    return a[0][axis] + a[1][axis] + a[2][axis] < b[0][axis] + b[1][axis] + b[2][axis];
  });
  build(first, count / 2);
  nodes_[number].first = static_cast<std::uint32_t>(nodes_.size());
  build(first + count / 2, count - count / 2);
}

SurfaceTree::Nearest SurfaceTree::nearest(const Vector3& p_MP, double radius,
                                          std::uint32_t& budget) const noexcept {
  Nearest nearest;
  if (nodes_.empty()) return nearest;
  double squared = radius * radius;
  const auto distance2 = [&](std::uint32_t node) {
    const Vector3 low = nodes_[node].low.cast<double>() - p_MP;
    const Vector3 high = p_MP - nodes_[node].high.cast<double>();
    return low.cwiseMax(high).cwiseMax(0.0).squaredNorm();
  };
  std::array<std::pair<std::uint32_t, double>, kMaxLevels> stack;
  std::size_t count = 0;
  stack[count++] = {0, distance2(0)};
  while (count > 0) {
    const auto [number, away2] = stack[--count];
    if (away2 > squared) continue;
    const Node& node = nodes_[number];
    if (node.count == 0) {
      // the nearer child first
      std::pair<std::uint32_t, double> near{number + 1, distance2(number + 1)};
      std::pair<std::uint32_t, double> far{node.first, distance2(node.first)};
      if (far.second < near.second) std::swap(near, far);
      stack[count++] = far;
      stack[count++] = near;
      continue;
    }
    if (budget < node.count) {
      budget = 0;
      nearest.found = false;
      return nearest;
    }
    budget -= node.count;
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Vector3 q = nearestOnTriangle(p_MP, triangles_[i]);
      const double found2 = (q - p_MP).squaredNorm();
      if (found2 > squared) continue;
      squared = found2;
      nearest = {true, std::sqrt(found2), q};
    }
  }
  return nearest;
}

}  // namespace tenon::structures
