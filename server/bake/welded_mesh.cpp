#include "server/bake/welded_mesh.h"

#include <algorithm>
#include <numeric>
#include <span>

namespace tenon {

namespace {

/// The direction in a triangle's plane, away from the edge a-b and square to it.
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

/// Calls visit(halves) for the triangles at each edge.
template <typename Half, typename Visit>
void visitEdges(const std::vector<Half>& halves, Visit&& visit) {
  for (std::size_t begin = 0; begin < halves.size();) {
    std::size_t end = begin + 1;
    while (end < halves.size() && halves[end].from == halves[begin].from &&
           halves[end].to == halves[begin].to)
      ++end;
    visit(std::span(halves).subspan(begin, end - begin));
    begin = end;
  }
}

}  // namespace

WeldedMesh::WeldedMesh(const TriangleMesh& mesh) {
  // equal positions get equal numbers, by rank
  const auto before = [&](std::uint32_t a, std::uint32_t b) {
    const Vector3f& pa = mesh.vertices[a];
    const Vector3f& pb = mesh.vertices[b];
    return std::lexicographical_compare(pa.data(), pa.data() + 3, pb.data(), pb.data() + 3);
  };
  std::vector<std::uint32_t> order(mesh.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), before);
  std::vector<std::uint32_t> number(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || before(order[i - 1], order[i])) positions.push_back(mesh.vertices[order[i]].cast<double>());
    number[order[i]] = static_cast<std::uint32_t>(positions.size() - 1);
  }

  std::vector<Corners> all;
  all.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    Corners t{number[a], number[b], number[c]};
    std::sort(t.begin(), t.end());
    if (t[0] != t[1] && t[1] != t[2]) all.push_back(t);
  }
  // rank order is an order in space as well: neighbours stay near in memory
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (const Corners& t : all) {
    const Triangle triangle{positions[t[0]], positions[t[1]], positions[t[2]]};
    if (!(areaOf(triangle) > 0.0)) continue;
    corners.push_back(t);
    triangles.push_back(triangle);
  }
  left_out = mesh.triangles.size() - triangles.size();
  closeHoles();
}

std::vector<WeldedMesh::Half> WeldedMesh::halves() const {
  std::vector<Half> all;
  all.reserve(corners.size() * 3);
  for (std::uint32_t i = 0; i < corners.size(); ++i) {
    const auto& [a, b, c] = corners[i];
    all.push_back({a, b, i});
    all.push_back({b, c, i});
    all.push_back({a, c, i});
  }
  std::sort(all.begin(), all.end());
  return all;
}

double WeldedMesh::bend(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                        std::uint32_t beyond) const {
  const Vector3& p_Ma = positions[a];
  const Vector3& p_Mb = positions[b];
  return awayFromEdge(p_Ma, p_Mb, positions[opposite(corners[triangle], a, b)])
      .dot(awayFromEdge(p_Ma, p_Mb, positions[beyond]));
}

void WeldedMesh::closeHoles() {
  // edges where the surface ends, found from either corner
  std::vector<Half> open;
  visitEdges(halves(), [&open](std::span<const Half> edge) {
    if (edge.size() != 1) return;
    const auto& [from, to, triangle] = edge.front();
    open.push_back({from, to, triangle});
    open.push_back({to, from, triangle});
  });
  std::sort(open.begin(), open.end());
  const auto at = [&open](std::uint32_t corner) {
    return std::ranges::equal_range(open, corner, {}, &Half::from);
  };
  constexpr double kCos120 = -0.5;
  for (const auto& [a, b, of_ab] : open) {
    if (a > b) continue;
    const bool fewer_at_a = at(a).size() < at(b).size();
    const auto others = fewer_at_a ? at(b) : at(a);
    for (const Half& side : fewer_at_a ? at(a) : at(b)) {
      const std::uint32_t c = side.to;
      if (c <= b) continue;
      const auto other = std::ranges::lower_bound(others, c, {}, &Half::to);
      if (other == others.end() || other->to != c) continue;
      // three edges of one triangle are no hole
      if (of_ab == side.triangle && of_ab == other->triangle) continue;
      const auto& [of_a, of_b] = fewer_at_a ? std::pair(side, *other) : std::pair(*other, side);
      const double straightest =
          std::min({bend(of_ab, a, b, c), bend(of_b.triangle, b, c, a), bend(of_a.triangle, a, c, b)});
      const Triangle patch{positions[a], positions[b], positions[c]};
      if (straightest > kCos120 || !(areaOf(patch) > 0.0)) continue;
      corners.push_back({a, b, c});
      triangles.push_back(patch);
      ++closed;
    }
  }
}

std::vector<WeldedMesh::Edge> WeldedMesh::sharpEdges() const {
  std::vector<Edge> open;
  std::vector<Edge> sharp;
  std::size_t edges = 0;
  visitEdges(halves(), [&](std::span<const Half> edge) {
    ++edges;
    const auto& [from, to, triangle] = edge.front();
    if (edge.size() == 1) open.push_back({from, to, triangle, Edge::kNone});
    if (edge.size() != 2) return;
    constexpr double kCos140 = -0.766;
    const std::uint32_t other = edge[1].triangle;
    if (bend(triangle, from, to, opposite(corners[other], from, to)) > kCos140) {
      sharp.push_back({from, to, triangle, other});
    }
  });
  // where nearly nothing is connected, an open edge says nothing about the shape
  if (open.size() * 3 < edges) sharp.insert(sharp.end(), open.begin(), open.end());
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

}  // namespace tenon
