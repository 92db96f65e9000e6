#include "server/bake/welded_mesh.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>
#include <utility>

namespace tenon::bake {

namespace {

/// The unit vector in a triangle's plane, perpendicular to the edge a-b and pointing away from it.
Vector3 awayFromEdge(const Vector3& a, const Vector3& b, const Vector3& opposite) {
  const Vector3 along = (b - a).normalized();
  const Vector3 to = opposite - a;
  return (to - along * along.dot(to)).normalized();
}

std::uint32_t opposite(const WeldedMesh::Corners& corners, std::uint32_t from, std::uint32_t to) {
  for (const std::uint32_t corner : corners) {
    if (corner != from && corner != to) return corner;
  }
  return corners[0];
}

/// Calls visit(half-edges) for each edge.
template <typename HalfEdge, typename Visit>
void visitEdges(const std::vector<HalfEdge>& half_edges, Visit&& visit) {
  for (std::size_t begin = 0; begin < half_edges.size();) {
    std::size_t end = begin + 1;
    while (end < half_edges.size() && half_edges[end].from == half_edges[begin].from &&
           half_edges[end].to == half_edges[begin].to)
      ++end;
    visit(std::span(half_edges).subspan(begin, end - begin));
    begin = end;
  }
}

/// Sorts elements whose order is first that of `firstOf(element)`, a number below `numbers` that few of them
/// share.
template <typename Element, typename FirstOf>
void sortWithFirst(std::vector<Element>& elements, std::size_t numbers, FirstOf&& firstOf) {
  // where the next element with each number goes; in the end behind the last
  std::vector<std::size_t> next(numbers + 1, 0);
  for (const Element& element : elements) ++next[firstOf(element) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<Element> sorted(elements.size());
  for (const Element& element : elements) sorted[next[firstOf(element)]++] = element;
  auto begin = sorted.begin();
  for (const std::size_t behind : next) {
    const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(behind);
    std::sort(begin, end);
    begin = end;
  }
  elements = std::move(sorted);
}

/// The distinct ones of some points, found by hash.
class DistinctPoints {
 public:
  explicit DistinctPoints(std::span<const Vector3f> points)
      : points_(points), slots_(std::bit_ceil(2 * points.size() + 1), kNone), numbers_(points.size()) {
    for (std::size_t i = 0; i < points.size(); ++i) numbers_[i] = find(static_cast<std::uint32_t>(i));
  }

  /// Of each point the number of its equals, in `firsts`.
  [[nodiscard]] const std::vector<std::uint32_t>& numbers() const { return numbers_; }
  /// One point of each kind.
  [[nodiscard]] const std::vector<std::uint32_t>& firsts() const { return firsts_; }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  [[nodiscard]] static std::uint64_t hashOf(const Vector3f& p) {
    std::uint64_t hash = 0;
    for (const float c : p) {  // 0 and -0 are equal
      hash = (hash ^ std::bit_cast<std::uint32_t>(c + 0.0F)) * 0x9E3779B97F4A7C15ULL;
      hash ^= hash >> 32U;
    }
    return hash;
  }

  std::uint32_t find(std::uint32_t i) {
    for (std::size_t at = hashOf(points_[i]);; ++at) {
      std::uint32_t& slot = slots_[at & (slots_.size() - 1)];
      if (slot != kNone && points_[firsts_[slot]] != points_[i]) continue;
      if (slot == kNone) {
        slot = static_cast<std::uint32_t>(firsts_.size());
        firsts_.push_back(i);
      }
      return slot;
    }
  }

  const std::span<const Vector3f> points_;
  std::vector<std::uint32_t> slots_;
  std::vector<std::uint32_t> numbers_;
  std::vector<std::uint32_t> firsts_;
};

/// Equal points get equal numbers: the rank of their position, which is in `positions`.
std::vector<std::uint32_t> weld(std::span<const Vector3f> points, std::vector<Vector3>& positions) {
  const DistinctPoints distinct(points);
  const std::vector<std::uint32_t>& firsts = distinct.firsts();
  std::vector<std::uint32_t> order(firsts.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Vector3f& pa = points[firsts[a]];
    const Vector3f& pb = points[firsts[b]];
    return std::lexicographical_compare(pa.data(), pa.data() + 3, pb.data(), pb.data() + 3);
  });
  std::vector<std::uint32_t> rank(order.size());
  positions.reserve(order.size());
  for (const std::uint32_t i : order) {
    rank[i] = static_cast<std::uint32_t>(positions.size());
    positions.push_back(points[firsts[i]].cast<double>());
  }
  std::vector<std::uint32_t> number = distinct.numbers();
  for (std::uint32_t& n : number) n = rank[n];
  return number;
}

}  // namespace

WeldedMesh::WeldedMesh(const TriangleMesh& mesh) {
  const std::vector<std::uint32_t> number = weld(mesh.vertices, positions);

  std::vector<WoundCorners> all;
  all.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const WoundCorners t = inAscendingOrder({number[a], number[b], number[c]}, 1);
    if (t.corners[0] != t.corners[1] && t.corners[1] != t.corners[2]) all.push_back(t);
  }
  build(std::move(all));
  skipped = mesh.triangles.size() - triangles.size();
  stitch();
  closeHoles();
  winding.resize(triangles.size(), 0);
}

WeldedMesh::WoundCorners WeldedMesh::inAscendingOrder(Corners c, int winding) {
  const bool same = ((c[0] < c[1]) + (c[1] < c[2]) + (c[2] < c[0])) == 2;
  std::sort(c.begin(), c.end());
  return {c, static_cast<std::int8_t>(same ? winding : -winding)};
}

void WeldedMesh::build(std::vector<WoundCorners> all) {
  corners.clear();
  triangles.clear();
  winding.clear();
  // ranks follow positions, so neighbours in space are near in memory
  sortWithFirst(all, positions.size(), [](const WoundCorners& t) { return t.corners[0]; });
  for (const auto& [t, wound] : all) {
    if (!corners.empty() && corners.back() == t) {
      winding.back() = static_cast<std::int8_t>(std::clamp(winding.back() + wound, -100, 100));
      continue;
    }
    const structures::Triangle triangle{positions[t[0]], positions[t[1]], positions[t[2]]};
    if (!(structures::areaOf(triangle) > 0.0)) continue;
    corners.push_back(t);
    triangles.push_back(triangle);
    winding.push_back(wound);
  }
}

std::vector<WeldedMesh::HalfEdge> WeldedMesh::halfEdges() const {
  std::vector<HalfEdge> all;
  all.reserve(corners.size() * 3);
  for (std::uint32_t i = 0; i < corners.size(); ++i) {
    const auto& [a, b, c] = corners[i];
    all.push_back({a, b, i});
    all.push_back({a, c, i});
    all.push_back({b, c, i});
  }
  sortWithFirst(all, positions.size(), [](const HalfEdge& edge) { return edge.from; });
  return all;
}

std::vector<WeldedMesh::HalfEdge> WeldedMesh::openEdges() const {
  std::vector<HalfEdge> open;
  visitEdges(halfEdges(), [&open](std::span<const HalfEdge> edge) {
    if (edge.size() == 1) open.push_back(edge.front());
  });
  return open;
}

double WeldedMesh::dihedralCosine(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                                  std::uint32_t beyond) const {
  const Vector3& p_Ma = positions[a];
  const Vector3& p_Mb = positions[b];
  return awayFromEdge(p_Ma, p_Mb, positions[opposite(corners[triangle], a, b)])
      .dot(awayFromEdge(p_Ma, p_Mb, positions[beyond]));
}

void WeldedMesh::closeHoles() {
  std::vector<HalfEdge> open = openEdges();
  for (std::size_t i = 0, count = open.size(); i < count; ++i) {  // in both directions
    const auto [from, to, triangle] = open[i];
    open.push_back({to, from, triangle});
  }
  std::sort(open.begin(), open.end());
  const auto at = [&open](std::uint32_t corner) {
    return std::ranges::equal_range(open, corner, {}, &HalfEdge::from);
  };
  constexpr double kCos120 = -0.5;
  for (const auto& [a, b, of_ab] : open) {
    if (a > b) continue;
    const bool fewer_at_a = at(a).size() < at(b).size();
    const auto others = fewer_at_a ? at(b) : at(a);
    for (const HalfEdge& side : fewer_at_a ? at(a) : at(b)) {
      const std::uint32_t c = side.to;
      if (c <= b) continue;
      const auto other = std::ranges::lower_bound(others, c, {}, &HalfEdge::to);
      if (other == others.end() || other->to != c) continue;
      // the three edges of a single triangle are not a hole
      if (of_ab == side.triangle && of_ab == other->triangle) continue;
      const auto& [of_a, of_b] = fewer_at_a ? std::pair(side, *other) : std::pair(*other, side);
      const double straightest =
          std::min({dihedralCosine(of_ab, a, b, c), dihedralCosine(of_b.triangle, b, c, a),
                    dihedralCosine(of_a.triangle, a, c, b)});
      const structures::Triangle patch{positions[a], positions[b], positions[c]};
      if (straightest > kCos120 || !(structures::areaOf(patch) > 0.0)) continue;
      corners.push_back({a, b, c});
      triangles.push_back(patch);
      ++closed;
    }
  }
}

std::vector<WeldedMesh::Edge> WeldedMesh::edges() const {
  constexpr double kAny = -2.0;  // [-] below all cosines
  return edgesAbove(kAny);
}

std::vector<WeldedMesh::Edge> WeldedMesh::sharpEdges() const {
  constexpr double kCos140 = -0.766;  // [-]
  return edgesAbove(kCos140);
}

std::vector<WeldedMesh::Edge> WeldedMesh::edgesAbove(double cosine) const {
  std::vector<Edge> open;
  std::vector<Edge> sharp;
  std::size_t edges = 0;
  visitEdges(halfEdges(), [&](std::span<const HalfEdge> edge) {
    ++edges;
    const auto& [from, to, triangle] = edge.front();
    if (edge.size() == 1) open.push_back({from, to, triangle, Edge::kNone});
    if (edge.size() != 2) return;
    const std::uint32_t other = edge[1].triangle;
    if (dihedralCosine(triangle, from, to, opposite(corners[other], from, to)) > cosine) {
      sharp.push_back({from, to, triangle, other});
    }
  });
  // In a mesh of unconnected triangles or quadrilaterals, 1 and 4/5 of the edges are open and most of them no
  // features of the shape; of a connected strip one half is. In a small mesh they cost little.
  constexpr std::size_t kSmall = 100;
  const bool is_connected = open.size() * 5 < edges * 3;
  if (is_connected || edges <= kSmall) sharp.insert(sharp.end(), open.begin(), open.end());
  return sharp;
}

std::pair<std::vector<std::uint32_t>, std::uint32_t> WeldedMesh::components() const {
  std::vector<std::uint32_t> parent(positions.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&parent](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& [a, b, c] : corners) {
    parent[root(b)] = root(a);
    parent[root(c)] = root(a);
  }
  std::vector<std::uint32_t> number_of_root(positions.size(), Edge::kNone);
  std::vector<std::uint32_t> numbers(corners.size());
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    std::uint32_t& number = number_of_root[root(corners[i][0])];
    if (number == Edge::kNone) number = count++;
    numbers[i] = number;
  }
  return {std::move(numbers), count};
}

}  // namespace tenon::bake
