#include "server/bake/face_sides.h"

namespace tenon::bake {
namespace {

/// [-] Of the area-weighted difference of the field to both sides, in voxels: a sheet has less.
constexpr double kMinDifference = 0.1;

Vector3 areaVector(const structures::Triangle& t) { return 0.5 * (t[1] - t[0]).cross(t[2] - t[0]); }

/// Whether a triangle's boundary, in the order of its vertices, runs from `edge.from` to `edge.to`.
bool runsAlong(const WeldedMesh::Corners& corners, const WeldedMesh::Edge& edge) {
  return !(corners[0] == edge.from && corners[2] == edge.to);
}

}  // namespace

FaceSides::FaceSides(const WeldedMesh& mesh, const std::vector<WeldedMesh::Edge>& edges,
                     const structures::DistanceField& field)
    : mesh_(mesh), sign_(mesh.triangles.size(), 0) {
  const Neighbours neighbours = neighboursOf(edges);
  std::vector<bool> visited(sign_.size(), false);
  std::vector<std::uint32_t> patch;
  for (std::uint32_t seed = 0; seed < sign_.size(); ++seed) {
    if (visited[seed]) continue;
    const bool orientable = orient(neighbours, seed, patch);
    for (const std::uint32_t i : patch) visited[i] = true;
    decide(patch, orientable, field);
  }
}

FaceSides::Neighbours FaceSides::neighboursOf(const std::vector<WeldedMesh::Edge>& edges) const {
  Neighbours neighbours(mesh_.triangles.size());
  const auto join = [&](std::uint32_t one, std::uint32_t other, std::int8_t same) {
    for (Neighbour& free : neighbours[one]) {
      if (free.triangle != WeldedMesh::Edge::kNone) continue;
      free = {other, same};
      return;
    }
  };
  for (const WeldedMesh::Edge& edge : edges) {
    if (edge.second == WeldedMesh::Edge::kNone) continue;
    const bool opposite =
        runsAlong(mesh_.corners[edge.first], edge) != runsAlong(mesh_.corners[edge.second], edge);
    const std::int8_t same = opposite ? 1 : -1;
    join(edge.first, edge.second, same);
    join(edge.second, edge.first, same);
  }
  return neighbours;
}

bool FaceSides::orient(const Neighbours& neighbours, std::uint32_t seed, std::vector<std::uint32_t>& patch) {
  patch.assign(1, seed);
  sign_[seed] = 1;
  bool orientable = true;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    for (const Neighbour& next : neighbours[patch[i]]) {
      if (next.triangle == WeldedMesh::Edge::kNone) continue;
      const auto sign = static_cast<std::int8_t>(sign_[patch[i]] * next.same);
      std::int8_t& known = sign_[next.triangle];
      if (known == 0) {
        known = sign;
        patch.push_back(next.triangle);
      }
      orientable = orientable && known == sign;
    }
  }
  return orientable;
}

void FaceSides::decide(const std::vector<std::uint32_t>& patch, bool orientable,
                       const structures::DistanceField& field) {
  double difference = 0.0;  // [m^2] weighted by area, in voxels
  double area = 0.0;        // [m^2]
  for (const std::uint32_t i : patch) {
    const structures::Triangle& t = mesh_.triangles[i];
    const Vector3 centre = (t[0] + t[1] + t[2]) / 3.0;
    const Vector3 a = areaVector(t) * sign_[i];
    const double voxel = field.voxelAt(centre);
    const Vector3 step = a.normalized() * (0.5 * voxel);
    area += a.norm();
    difference +=
        a.norm() * (field.sample(centre + step).distance - field.sample(centre - step).distance) / voxel;
  }
  const bool decided = orientable && std::abs(difference) > kMinDifference * area;
  for (const std::uint32_t i : patch)
    sign_[i] = static_cast<std::int8_t>(!decided ? 0 : difference > 0.0 ? sign_[i] : -sign_[i]);
}

Vector3 FaceSides::outward(std::uint32_t triangle) const {
  return areaVector(mesh_.triangles[triangle]).normalized() * sign_[triangle];
}

}  // namespace tenon::bake
