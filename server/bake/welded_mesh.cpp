#include "server/bake/welded_mesh.h"

#include <algorithm>
#include <numeric>

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
}

std::vector<WeldedMesh::Edge> WeldedMesh::sharpEdges() const {
  struct Half {
    std::uint32_t from, to, triangle;
    auto operator<=>(const Half&) const = default;
  };
  std::vector<Half> halves;
  halves.reserve(corners.size() * 3);
  for (std::uint32_t i = 0; i < corners.size(); ++i) {
    const auto& [a, b, c] = corners[i];
    halves.push_back({a, b, i});
    halves.push_back({b, c, i});
    halves.push_back({a, c, i});
  }
  std::sort(halves.begin(), halves.end());

  std::vector<Edge> open;
  std::vector<Edge> sharp;
  std::size_t edges = 0;
  for (std::size_t begin = 0; begin < halves.size(); ++edges) {
    const Half& half = halves[begin];
    std::size_t end = begin + 1;
    while (end < halves.size() && halves[end].from == half.from && halves[end].to == half.to) ++end;
    if (end - begin == 1) open.push_back({half.from, half.to, half.triangle, Edge::kNone});
    if (end - begin == 2) {
      const std::uint32_t other = halves[begin + 1].triangle;
      const Vector3& a = positions[half.from];
      const Vector3& b = positions[half.to];
      const Vector3 first =
          awayFromEdge(a, b, positions[opposite(corners[half.triangle], half.from, half.to)]);
      const Vector3 second = awayFromEdge(a, b, positions[opposite(corners[other], half.from, half.to)]);
      constexpr double kCos140 = -0.766;
      if (first.dot(second) > kCos140) sharp.push_back({half.from, half.to, half.triangle, other});
    }
    begin = end;
  }
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
