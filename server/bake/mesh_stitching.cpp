#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "server/bake/triangle_tree.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/point_grid.h"

namespace tenon::bake {
namespace {

/// A vertex on an open edge, at a distance [m] from its first vertex.
struct OnEdge {
  double at;
  std::uint32_t vertex;
  auto operator<=>(const OnEdge&) const = default;
};

}  // namespace

void WeldedMesh::stitch() {
  const std::vector<HalfEdge> open = openEdges();
  if (open.empty()) return;
  Eigen::AlignedBox3d box;
  for (const structures::Triangle& triangle : triangles) box.extend(structures::boxOf(triangle));
  const double near = std::min(kStitch, 1e-4 * box.diagonal().norm());
  joinVertices(open, near);
  constexpr int kMostPasses = 10;
  for (int pass = 0; pass < kMostPasses && splitEdges(near); ++pass) continue;
}

void WeldedMesh::joinVertices(const std::vector<HalfEdge>& open, double near) {
  std::vector<std::uint32_t> vertices;
  for (const HalfEdge& edge : open) vertices.insert(vertices.end(), {edge.from, edge.to});
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  structures::PointGrid kept(near);
  std::map<std::uint32_t, std::uint32_t> becomes;
  for (const std::uint32_t vertex : vertices) {
    std::uint32_t first = vertex;
    kept.visitNear(positions[vertex], [&](std::uint32_t other, double squared) {
      if (squared < near * near) first = std::min(first, other);
      return true;
    });
    if (first == vertex) {
      kept.add(positions[vertex], vertex);
    } else {
      becomes.emplace(vertex, first);
    }
  }
  joined = becomes.size();
  if (becomes.empty()) return;
  std::vector<WoundCorners> all;
  all.reserve(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    Corners moved = corners[i];
    for (std::uint32_t& corner : moved)
      if (const auto found = becomes.find(corner); found != becomes.end()) corner = found->second;
    const WoundCorners t = inAscendingOrder(moved, winding[i]);
    if (t.corners[0] != t.corners[1] && t.corners[1] != t.corners[2]) all.push_back(t);
  }
  build(std::move(all));
}

bool WeldedMesh::splitEdges(double near) {
  std::vector<HalfEdge> open = openEdges();
  std::vector<std::uint32_t> count(positions.size(), 0);
  for (const HalfEdge& edge : open) {
    ++count[edge.from];
    ++count[edge.to];
  }
  // a fan of unconnected triangles is no border, and each point is in the boxes of half its edges
  constexpr std::uint32_t kFan = 1000;
  std::erase_if(open,
                [&](const HalfEdge& edge) { return std::max(count[edge.from], count[edge.to]) > kFan; });
  if (open.empty()) return false;
  std::vector<structures::Triangle> segments;
  double length = 0.0;
  for (const HalfEdge& edge : open) {
    segments.push_back({positions[edge.from], positions[edge.to], positions[edge.to]});
    length += (positions[edge.to] - positions[edge.from]).norm();
  }
  const TriangleTree tree(segments, 2.0 * length / static_cast<double>(open.size()));
  std::map<std::uint32_t, std::vector<OnEdge>> on_edges;  // by edge
  for (std::uint32_t vertex = 0; vertex < positions.size(); ++vertex) {
    if (count[vertex] == 0) continue;
    // the nearest one alone: near a sharp corner of a face a vertex is near both its edges
    std::optional<std::uint32_t> nearest;
    double least = near * near;
    for (const std::uint32_t i : tree.within(positions[vertex], near)) {
      if (std::ranges::find(corners[open[i].triangle], vertex) != corners[open[i].triangle].end()) continue;
      const double squared = structures::squaredDistance(positions[vertex], segments[i]);
      if (!(squared < least)) continue;
      least = squared;
      nearest = i;
    }
    if (nearest)
      on_edges[*nearest].push_back({(positions[vertex] - positions[open[*nearest].from]).norm(), vertex});
  }
  std::vector<std::uint8_t> is_split(corners.size(), 0);
  const std::size_t before = split;
  for (auto& [i, on_edge] : on_edges) {
    const auto& [from, to, triangle] = open[i];
    if (is_split[triangle] != 0) continue;
    std::sort(on_edge.begin(), on_edge.end());
    on_edge.push_back({0.0, to});
    // from the edge's vertices to its triangle's third one
    std::vector<WoundCorners> parts;
    std::uint32_t begin = from;
    for (const OnEdge& end : on_edge) {
      Corners part = corners[triangle];
      std::ranges::replace(part, to, end.vertex);
      if (begin != from) std::ranges::replace(part, from, begin);
      parts.push_back(inAscendingOrder(part, winding[triangle]));
      begin = end.vertex;
    }
    std::vector<structures::Triangle> pieces;
    for (const auto& [c, wound] : parts)
      pieces.push_back({positions[c[0]], positions[c[1]], positions[c[2]]});
    if (!std::ranges::all_of(pieces, [](const auto& piece) { return structures::areaOf(piece) > 0.0; }))
      continue;
    corners[triangle] = parts[0].corners;
    winding[triangle] = parts[0].winding;
    triangles[triangle] = pieces[0];
    for (std::size_t k = 1; k < parts.size(); ++k) {
      corners.push_back(parts[k].corners);
      winding.push_back(parts[k].winding);
      triangles.push_back(pieces[k]);
    }
    is_split[triangle] = 1;
    ++split;
  }
  return split > before;
}

}  // namespace tenon::bake
