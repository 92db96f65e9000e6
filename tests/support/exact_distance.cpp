#include "tests/support/exact_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace tenon::test {

namespace {

constexpr std::uint32_t kLeaf = 4;

Vector3 nearestOnSegment(const Vector3& p, const Vector3& a, const Vector3& b) {
  const Vector3 ab = b - a;
  const double length = ab.squaredNorm();
  const double along = length > 0.0 ? std::clamp((p - a).dot(ab) / length, 0.0, 1.0) : 0.0;
  return a + along * ab;
}

/// The projection onto the plane if it lies in the triangle, else the nearest point of the three edges.
/// Independent of the implementation under test.
Vector3 nearestOnTriangle(const Vector3& p, const std::array<Vector3, 3>& t) {
  const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  const double squared = normal.squaredNorm();
  if (squared > 0.0) {
    const Vector3 foot = p - normal * (normal.dot(p - t[0]) / squared);
    bool within = true;
    for (std::size_t i = 0; i < 3; ++i) {
      within = within && normal.dot((t[(i + 1) % 3] - t[i]).cross(foot - t[i])) >= 0.0;
    }
    if (within) return foot;
  }
  Vector3 best = nearestOnSegment(p, t[0], t[1]);
  for (const Vector3& other : {nearestOnSegment(p, t[1], t[2]), nearestOnSegment(p, t[2], t[0])}) {
    if ((other - p).squaredNorm() < (best - p).squaredNorm()) best = other;
  }
  return best;
}

}  // namespace

ExactDistance::ExactDistance(std::span<const Vector3f> vertices,
                             std::span<const std::array<std::uint32_t, 3>> triangles)
    : order_(triangles.size()) {
  for (const auto& [a, b, c] : triangles) {
    triangles_.push_back(
        {vertices[a].cast<double>(), vertices[b].cast<double>(), vertices[c].cast<double>()});
  }
  std::iota(order_.begin(), order_.end(), 0U);
  if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
}

std::uint32_t ExactDistance::build(std::uint32_t first, std::uint32_t count) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Eigen::AlignedBox3d box;
  for (std::uint32_t i = first; i < first + count; ++i) {
    for (const Vector3& p : triangles_[order_[i]]) box.extend(p);
  }
  nodes_[index].box = box;
  nodes_[index].first = first;
  if (count <= kLeaf) {
    nodes_[index].count = count;
    return index;
  }
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    const auto middle = [&](std::uint32_t t) {
      return triangles_[t][0][axis] + triangles_[t][1][axis] + triangles_[t][2][axis];
    };
    return middle(a) < middle(b);
  });
  const std::uint32_t left = build(first, count / 2);
  const std::uint32_t right = build(first + count / 2, count - count / 2);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

void ExactDistance::search(std::uint32_t index, const Vector3& p, Nearest& best, double& squared) const {
  const Node& node = nodes_[index];
  if (node.count > 0) {
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Vector3 q = nearestOnTriangle(p, triangles_[order_[i]]);
      if ((q - p).squaredNorm() >= squared) continue;
      squared = (q - p).squaredNorm();
      best = {std::sqrt(squared), q, order_[i]};
    }
    return;
  }
  const double to_left = nodes_[node.left].box.squaredExteriorDistance(p);
  const double to_right = nodes_[node.right].box.squaredExteriorDistance(p);
  const bool left_first = to_left <= to_right;
  if (std::min(to_left, to_right) < squared) search(left_first ? node.left : node.right, p, best, squared);
  if (std::max(to_left, to_right) < squared) search(left_first ? node.right : node.left, p, best, squared);
}

ExactDistance::Nearest ExactDistance::nearest(const Vector3& p_MP) const {
  Nearest best;
  double squared = std::numeric_limits<double>::infinity();
  if (!nodes_.empty()) search(0, p_MP, best, squared);
  return best;
}

void ExactDistance::sumNormals(std::uint32_t index, const Vector3& q, Vector3& sum) const {
  constexpr double kTouching = 1e-9;  // [m]
  const Node& node = nodes_[index];
  if (node.box.squaredExteriorDistance(q) > kTouching * kTouching) return;
  if (node.count == 0) {
    sumNormals(node.left, q, sum);
    sumNormals(node.right, q, sum);
    return;
  }
  for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
    const std::array<Vector3, 3>& t = triangles_[order_[i]];
    if ((nearestOnTriangle(q, t) - q).norm() > kTouching) continue;
    double angle = std::numbers::pi;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3 to_next = t[(k + 1) % 3] - t[k];
      const Vector3 to_last = t[(k + 2) % 3] - t[k];
      if ((t[k] - q).norm() <= kTouching)
        angle = std::atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
    }
    sum += angle * (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  }
}

bool ExactDistance::behindNearest(const Vector3& p_MP) const {
  if (nodes_.empty()) return false;
  const Vector3 q = nearest(p_MP).p_MQ;
  Vector3 normal = Vector3::Zero();
  sumNormals(0, q, normal);
  return normal.dot(p_MP - q) < 0.0;
}

bool ExactDistance::inside(const Vector3& p_MP) const {
  double half_angles = 0.0;
  for (const auto& t : triangles_) {
    // van Oosterom and Strackee 1983
    const Vector3 a = t[0] - p_MP;
    const Vector3 b = t[1] - p_MP;
    const Vector3 c = t[2] - p_MP;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    half_angles +=
        std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  // a full sphere is 4 pi, so half angles sum to 2 pi inside
  return std::abs(half_angles) > 3.14159265358979;
}

}  // namespace tenon::test
