#include "server/bake/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tenon::bake {

/// Builds the tree: splits at the median along the longest axis, twice for each node.
struct TriangleTree::Builder {
  /// The box of a triangle, or of a part of one.
  struct BoundedPart {
    Eigen::AlignedBox3f box;
    std::uint32_t triangle;
  };
  using Range = std::span<BoundedPart>;

  TriangleTree& tree;
  std::vector<BoundedPart> parts;

  /// Adds a triangle; long ones in parts, because the box around a whole one would be nearly empty.
  void add(std::uint32_t triangle, const structures::Triangle& t, double longest) {
    std::size_t from = 0;
    if (structures::longestEdge(t, from) > longest) {
      for (const structures::Triangle& half : structures::bisected(t, from)) add(triangle, half, longest);
      return;
    }
    Eigen::AlignedBox3f box;
    for (const Vector3& corner : t) box.extend(tree.local(corner));
    // twice, for the rounding of the query point
    const Vector3f slack = Vector3f::Constant(2.0F * tree.slack_);
    parts.push_back({{box.min() - slack, box.max() + slack}, triangle});
  }

  static std::size_t split(Range range) {
    Eigen::AlignedBox3f box;
    for (const BoundedPart& part : range) box.extend(part.box.center());
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    const auto middle = static_cast<std::ptrdiff_t>(range.size() / 2);
    std::nth_element(range.begin(), range.begin() + middle, range.end(),
                     [axis](const BoundedPart& a, const BoundedPart& b) {
                       const float ca = a.box.min()[axis] + a.box.max()[axis];
                       const float cb = b.box.min()[axis] + b.box.max()[axis];
                       return ca != cb ? ca < cb : a.triangle < b.triangle;
                     });
    return range.size() / 2;
  }

  /// Builds the node of a range and returns its bounding box.
  Eigen::AlignedBox3f build(std::uint32_t number, Range range) {
    std::array<Range, 4> quarters{};
    std::size_t count = 0;
    if (range.size() <= 4) {
      for (std::size_t i = 0; i < range.size(); ++i) quarters[count++] = range.subspan(i, 1);
    } else {
      const std::size_t middle = split(range);
      for (const Range half : {range.first(middle), range.subspan(middle)}) {
        const std::size_t quarter = split(half);
        quarters[count++] = half.first(quarter);
        quarters[count++] = half.subspan(quarter);
      }
    }
    Eigen::AlignedBox3f whole;
    constexpr float kFar = std::numeric_limits<float>::max();
    for (std::size_t lane = 0; lane < 4; ++lane) {
      std::uint32_t child = kNothing;
      Eigen::AlignedBox3f box(Vector3f::Constant(kFar), Vector3f::Constant(kFar));
      if (quarters[lane].size() == 1) {
        child = kTriangle + quarters[lane].front().triangle;
        box = quarters[lane].front().box;
      } else if (!quarters[lane].empty()) {
        child = static_cast<std::uint32_t>(tree.nodes_.size());
        tree.nodes_.emplace_back();
        box = build(child, quarters[lane]);
      }
      Node& node = tree.nodes_[number];
      node.child[lane] = child;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        node.low[axis][static_cast<Eigen::Index>(lane)] = box.min()[static_cast<Eigen::Index>(axis)];
        node.high[axis][static_cast<Eigen::Index>(lane)] = box.max()[static_cast<Eigen::Index>(axis)];
      }
      if (child != kNothing) whole.extend(box);
    }
    return whole;
  }

  /// [m] `longest`, doubled until the triangles have a few million parts at most.
  static double limitParts(std::span<const structures::Triangle> triangles, double longest) {
    const double most = 4e6 + static_cast<double>(triangles.size());
    while (true) {
      double count = 0.0;
      for (const structures::Triangle& t : triangles) {
        std::size_t from = 0;
        const double across = structures::longestEdge(t, from) / longest;
        count += across <= 1.0 ? 1.0 : 2.0 * across + 8.0 * structures::areaOf(t) / (longest * longest);
      }
      if (!(count > most)) return longest;
      longest *= 2.0;
    }
  }
};

TriangleTree::TriangleTree(std::span<const structures::Triangle> triangles, double longest)
    : triangles_(triangles.begin(), triangles.end()) {
  if (triangles.empty()) return;
  Eigen::AlignedBox3d box;
  for (const structures::Triangle& t : triangles) box.extend(structures::boxOf(t));
  centre_ = box.center();
  slack_ = static_cast<float>(box.diagonal().norm()) * std::numeric_limits<float>::epsilon();
  Builder builder{*this, {}};
  builder.parts.reserve(triangles.size());
  longest = Builder::limitParts(triangles, longest);
  for (std::uint32_t i = 0; i < triangles.size(); ++i) builder.add(i, triangles[i], longest);
  nodes_.reserve(builder.parts.size() / 2 + 1);
  nodes_.emplace_back();
  builder.build(0, builder.parts);
}

std::vector<std::uint32_t> TriangleTree::within(const Vector3& p, double radius) const {
  std::vector<std::uint32_t> near;
  visitWithin(p, radius, [&](const structures::Triangle& triangle) {
    near.push_back(static_cast<std::uint32_t>(&triangle - triangles_.data()));
    return false;
  });
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());  // long ones come more than once
  return near;
}

bool TriangleTree::maybeNear(const Vector3& centre, double half_edge, double radius) const {
  if (nodes_.empty()) return false;
  const auto nearBox = [&](const structures::Triangle& t) {
    const Eigen::AlignedBox3d box(centre - Vector3::Constant(half_edge),
                                  centre + Vector3::Constant(half_edge));
    if (box.squaredExteriorDistance(structures::boxOf(t)) >= radius * radius) return false;
    // the cube's corners are this much nearer to the plane than its centre
    const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
    const double above = std::abs(normal.dot(centre - t[0])) - half_edge * normal.lpNorm<1>();
    return !(above > (radius + slack_) * normal.norm());
  };
  const Vector3f p_local = local(centre);
  const auto half = static_cast<float>(half_edge * (1.0 + kRounding));
  const double squared = radius * radius;
  std::array<std::uint32_t, 128> stack;  // as in visitWithin
  std::size_t count = 0;
  stack[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[stack[--count]];
    const Lanes away = node.squaredDistances(p_local, half) * (1.0F - kRounding);
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if (!(away[static_cast<Eigen::Index>(lane)] < squared) || node.child[lane] == kNothing) continue;
      if ((node.child[lane] & kTriangle) == 0) {
        stack[count++] = node.child[lane];
      } else if (nearBox(triangles_[node.child[lane] - kTriangle])) {
        return true;
      }
    }
  }
  return false;
}

TriangleTree::Node TriangleTree::emptyNode() {
  Node empty;
  empty.low.fill(Lanes::Constant(std::numeric_limits<float>::max()));
  empty.high = empty.low;
  empty.child.fill(kNothing);
  return empty;
}

void TriangleTree::Node::take(std::size_t lane, const Node& from, std::size_t source) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis][static_cast<Eigen::Index>(lane)] = from.low[axis][static_cast<Eigen::Index>(source)];
    high[axis][static_cast<Eigen::Index>(lane)] = from.high[axis][static_cast<Eigen::Index>(source)];
  }
  child[lane] = from.child[source];
}

std::vector<std::uint32_t> TriangleTree::crossed(const Vector3& p, const Vector3& direction) const {
  std::vector<std::uint32_t> crossed;
  if (nodes_.empty()) return crossed;
  const Vector3f p_local = local(p);
  const Vector3f inverse = direction.cwiseInverse().cast<float>();
  std::array<std::uint32_t, 128> stack;  // as in visitWithin
  std::size_t count = 0;
  stack[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[stack[--count]];
    const std::array<bool, 4> met = node.intersectedBy(p_local, inverse, std::numeric_limits<float>::max());
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const std::uint32_t child = node.child[lane];
      if (!met[lane] || child == kNothing) continue;
      if ((child & kTriangle) == 0) {
        stack[count++] = child;
      } else if (structures::rayIntersects(p, direction, triangles_[child - kTriangle])) {
        crossed.push_back(child - kTriangle);
      }
    }
  }
  // a long triangle is found in several boxes
  std::sort(crossed.begin(), crossed.end());
  crossed.erase(std::unique(crossed.begin(), crossed.end()), crossed.end());
  return crossed;
}

bool TriangleTree::oddCrossings(const Vector3& p, const Vector3& direction) const {
  return crossed(p, direction).size() % 2 == 1;
}

TriangleTree::Intersection TriangleTree::firstIntersection(const Vector3& p, const Vector3& along) const {
  Intersection first;
  if (nodes_.empty()) return first;
  const Vector3f p_local = local(p);
  const double smallest = 1e-9 * along.cwiseAbs().maxCoeff();
  const Vector3f inverse =
      along.unaryExpr([smallest](double c) { return std::abs(c) < smallest ? smallest : c; })
          .cwiseInverse()
          .cast<float>();
  std::array<std::uint32_t, 128> stack;  // as in visitWithin
  std::size_t count = 0;
  stack[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[stack[--count]];
    const std::array<bool, 4> met = node.intersectedBy(p_local, inverse, static_cast<float>(first.fraction));
    for (std::size_t lane = 0; lane < 4; ++lane) {
      const std::uint32_t child = node.child[lane];
      if (!met[lane] || child == kNothing) continue;
      if ((child & kTriangle) == 0) {
        stack[count++] = child;
        continue;
      }
      const structures::Triangle& t = triangles_[child - kTriangle];
      if (!structures::rayIntersects(p, along, t)) continue;
      const Vector3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
      const double fraction = normal.dot(t[0] - p) / normal.dot(along);
      if (fraction < first.fraction) first = {fraction, &t};
    }
  }
  return first;
}

}  // namespace tenon::bake
