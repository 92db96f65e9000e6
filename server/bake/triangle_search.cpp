#include <algorithm>
#include <bit>
#include <cmath>

#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

// A search starts from about this many boxes instead of the root.
constexpr std::size_t kRoots = 24;
// [-] That of distances from the centre of a focus, with a margin.
constexpr double kFocusRounding = 1e-6;
// More triangles are not listed one by one.
constexpr std::size_t kMostCandidates = 512;
// [rounding errors of a point] That of its distance from a plane, with a margin.
constexpr float kPlaneSlack = 8.0F;

}  // namespace

TriangleTree::Search::Search(const TriangleTree& tree, const Vector3& centre, double radius, double reach)
    : tree_(tree) {
  if (tree.nodes_.empty()) return;
  const Vector3f p_local = tree.local(centre);
  const double far = (radius + reach) * (radius + reach);
  struct Root {
    std::uint32_t node;
    std::size_t lane;
  };
  std::vector<Root> found;
  std::vector<std::uint32_t> queue{0};
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const Node& node = tree.nodes_[queue[next]];
    const Lanes away = node.squaredDistances(p_local) * (1.0F - kRounding);
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if (!(away[static_cast<Eigen::Index>(lane)] < far) || node.child[lane] == kNothing) continue;
      const bool open = (node.child[lane] & kTriangle) == 0 && found.size() + queue.size() - next < kRoots;
      if (open) {
        queue.push_back(node.child[lane]);
      } else {
        found.push_back({queue[next], lane});
      }
    }
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i % 4 == 0) roots_.push_back(emptyNode());
    roots_.back().take(i % 4, tree.nodes_[found[i].node], found[i].lane);
  }
}

void TriangleTree::Search::visit(const Node& node, const Vector3& p, const Vector3f& p_local,
                                 double& squared) {
  std::array<float, 4> away;
  Lanes::Map(away.data()) = node.squaredDistances(p_local) * (1.0F - kRounding);
  // squared, rounded up
  const float limit = static_cast<float>(squared) * (1.0F + kRounding);
  unsigned remaining = 0;
  for (unsigned lane = 0; lane < 4; ++lane) remaining |= static_cast<unsigned>(away[lane] < limit) << lane;
  while (remaining != 0) {
    // the nearest box first, so that the others are likely to be pruned
    auto lane = static_cast<unsigned>(std::countr_zero(remaining));
    for (unsigned other = lane + 1; other < 4; ++other) {
      if ((remaining >> other & 1U) != 0 && away[other] < away[lane]) lane = other;
    }
    if (!(away[lane] < squared)) return;
    remaining &= ~(1U << lane);
    const std::uint32_t child = node.child[lane];
    if (child == kNothing) continue;
    if ((child & kTriangle) == 0) {
      visit(tree_.nodes_[child], p, p_local, squared);
      continue;
    }
    const double candidate = tenon::structures::squaredDistance(p, tree_.triangles_[child - kTriangle]);
    if (candidate >= squared) continue;
    squared = candidate;
    last_ = child - kTriangle;
  }
}

void TriangleTree::Search::visitLeaves(const Leaves& leaves, const Vector3& p, const Vector3f& p_local,
                                       double& squared) {
  const Lanes above = leaves.normals[0] * p_local.x() + leaves.normals[1] * p_local.y() +
                      leaves.normals[2] * p_local.z() - leaves.offsets;
  const Lanes from_plane = (above.abs() - kPlaneSlack * tree_.slack_).max(0.0F);
  std::array<float, 4> away;
  Lanes::Map(away.data()) =
      leaves.boxes.squaredDistances(p_local).max(from_plane * from_plane) * (1.0F - kRounding);
  for (unsigned lane = 0; lane < 4; ++lane) {
    const std::uint32_t triangle = leaves.boxes.child[lane] - kTriangle;
    if (!(away[lane] < squared) || leaves.boxes.child[lane] == kNothing || triangle == last_) continue;
    const double candidate = tenon::structures::squaredDistance(p, tree_.triangles_[triangle]);
    if (candidate >= squared) continue;
    squared = candidate;
    last_ = triangle;
  }
}

void TriangleTree::Search::collect(const Node& node, const Vector3& p, const Vector3f& p_local, double spread,
                                   double& far) {
  std::array<float, 4> away;
  Lanes::Map(away.data()) = node.squaredDistances(p_local) * (1.0F - kRounding);
  unsigned remaining = 0xF;
  while (remaining != 0 && candidates_.size() <= kMostCandidates) {
    // the nearest box first, as the limit decreases
    auto lane = static_cast<unsigned>(std::countr_zero(remaining));
    for (unsigned other = lane + 1; other < 4; ++other) {
      if ((remaining >> other & 1U) != 0 && away[other] < away[lane]) lane = other;
    }
    if (!(away[lane] < far * far)) return;
    remaining &= ~(1U << lane);
    const std::uint32_t child = node.child[lane];
    if (child == kNothing) continue;
    if ((child & kTriangle) == 0) {
      collect(tree_.nodes_[child], p, p_local, spread, far);
      continue;
    }
    const double distance =
        std::sqrt(tenon::structures::squaredDistance(p, tree_.triangles_[child - kTriangle]));
    if (distance >= far) continue;
    candidates_.push_back({distance, &node, lane});
    far = std::min(far, distance + spread);
  }
}

void TriangleTree::Search::listCandidates(double far) {
  std::erase_if(candidates_, [far](const Candidate& candidate) { return candidate.distance > far; });
  std::sort(candidates_.begin(), candidates_.end(),
            [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
  leaves_.resize((candidates_.size() + 3) / 4);
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const Candidate& candidate = candidates_[i];
    Leaves& leaves = leaves_[i / 4];
    if (i % 4 == 0) {
      leaves.boxes = emptyNode();
      leaves.normals.fill(Lanes::Zero());
      leaves.offsets = Lanes::Zero();
      leaves.nearest = candidate.distance;
    }
    const auto lane = static_cast<Eigen::Index>(i % 4);
    leaves.boxes.take(i % 4, *candidate.node, candidate.lane);
    const structures::Triangle& t = tree_.triangles_[candidate.node->child[candidate.lane] - kTriangle];
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
    if (!normal.allFinite()) continue;
    for (std::size_t axis = 0; axis < 3; ++axis)
      leaves.normals[axis][lane] = static_cast<float>(normal[static_cast<Eigen::Index>(axis)]);
    // with the rounded normal, so that the plane still contains the triangle to within rounding
    leaves.offsets[lane] = static_cast<float>(normal.dot(t[0] - tree_.centre_));
  }
}

bool TriangleTree::Search::focus(const Vector3& centre, double radius, double reach) {
  focused_ = false;
  candidates_.clear();
  slack_ = kFocusRounding * (radius + reach);
  const double wide = radius + slack_;
  double far = reach + wide;
  if (last_ != kNothing) {
    const double found = std::sqrt(tenon::structures::squaredDistance(centre, tree_.triangles_[last_]));
    far = std::min(far, found + slack_ + 2.0 * wide);
  }
  const Vector3f p_local = tree_.local(centre);
  for (const Node& root : roots_) collect(root, centre, p_local, 2.0 * wide, far);
  if (candidates_.empty()) return false;
  if (candidates_.size() > kMostCandidates) return true;
  listCandidates(far);
  focus_ = centre;
  focused_ = true;
  return true;
}

double TriangleTree::Search::squaredDistance(const Vector3& p, double reach) {
  double squared = reach * reach;
  if (last_ != kNothing) {
    squared = std::min(squared, tenon::structures::squaredDistance(p, tree_.triangles_[last_]));
  }
  const Vector3f p_local = tree_.local(p);
  if (!focused_) {
    for (const Node& root : roots_) visit(root, p, p_local, squared);
    return squared;
  }
  const double away = (p - focus_).norm() + slack_;
  for (const Leaves& leaves : leaves_) {
    const double nearest = leaves.nearest - away;
    if (nearest > 0.0 && nearest * nearest >= squared) break;
    visitLeaves(leaves, p, p_local, squared);
  }
  return squared;
}

}  // namespace tenon::bake
