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
    nearest_ = child - kTriangle;
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
    candidates_.push_back({distance, child - kTriangle});
    far = std::min(far, distance + spread);
  }
}

bool TriangleTree::Search::focus(const Vector3& centre, double radius, double reach) {
  candidates_.clear();
  const double slack = kFocusRounding * (radius + reach);
  wide_ = radius + slack;
  double far = reach + wide_;
  if (nearest_ != kNothing) {
    const double found = std::sqrt(tenon::structures::squaredDistance(centre, tree_.triangles_[nearest_]));
    far = std::min(far, found + slack + 2.0 * wide_);
  }
  const Vector3f p_local = tree_.local(centre);
  for (const Node& root : roots_) collect(root, centre, p_local, 2.0 * wide_, far);
  if (candidates_.empty()) return false;
  listed_ = candidates_.size() <= kMostCandidates;
  if (!listed_) return true;
  std::erase_if(candidates_, [far](const Candidate& candidate) { return candidate.distance > far; });
  std::sort(candidates_.begin(), candidates_.end(),
            [](const Candidate& a, const Candidate& b) { return a.distance < b.distance; });
  nearest_ = candidates_.front().triangle;
  return true;
}

void TriangleTree::Search::lower(PointBlock& block) {
  if (!listed_) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const Vector3 p = block.point(i);
      double squared = block.squared(i);
      if (nearest_ != kNothing)
        squared = std::min(squared, tenon::structures::squaredDistance(p, tree_.triangles_[nearest_]));
      for (const Node& root : roots_) visit(root, p, tree_.local(p), squared);
      block.setSquared(i, squared);
    }
    return;
  }
  const double rounding = kPlaneSlack * tree_.slack_;
  std::uint32_t last = kNothing;
  for (const Candidate& candidate : candidates_) {
    const double nearest = candidate.distance - wide_;
    if (nearest > 0.0 && nearest * nearest >= block.largest()) break;
    // a long triangle is found in several boxes
    if (candidate.triangle == last) continue;
    last = candidate.triangle;
    const double slack = rounding * (rounding + 2.0 * std::sqrt(block.largest()));
    block.lower(tree_.triangles_[candidate.triangle], slack);
  }
}

}  // namespace tenon::bake
