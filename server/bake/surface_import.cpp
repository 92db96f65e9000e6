#include "server/bake/surface_import.h"

#include <string>
#include <utility>

#include "server/bake/bake.h"
#include "server/structures/outer_surface.h"

namespace tenon::bake {

namespace {

using SurfaceTriangle = structures::SurfaceTree::Triangle;

Result<std::vector<SurfaceTriangle>> trianglesOf(const std::vector<std::filesystem::path>& meshes,
                                                 double unit) {
  std::vector<SurfaceTriangle> triangles;
  for (const auto& file : meshes) {
    const auto mesh = importMesh(file, unit);
    if (!mesh) return tl::unexpected(mesh.error());
    for (const auto& [a, b, c] : mesh->triangles) {
      triangles.push_back({mesh->vertices[a], mesh->vertices[b], mesh->vertices[c]});
    }
  }
  return triangles;
}

bool hasBoundingBox(const std::vector<SurfaceTriangle>& triangles, const Eigen::AlignedBox3d& wanted) {
  Eigen::AlignedBox3d box;
  for (const SurfaceTriangle& corners : triangles) {
    for (const Vector3f& corner : corners) box.extend(corner.cast<double>());
  }
  const double tolerance = 1e-4 * wanted.diagonal().norm();
  return (box.min() - wanted.min()).norm() <= tolerance && (box.max() - wanted.max()).norm() <= tolerance;
}

}  // namespace

Result<structures::SurfaceTree> importSurface(const structures::HapticStructures& structures,
                                              std::vector<std::filesystem::path> meshes) {
  if (meshes.empty()) meshes = structures.info.meshes;
  if (meshes.empty()) return fail(structures.info.source + ": the structures do not name their mesh files");
  const auto triangles = trianglesOf(meshes, structures.info.unit);
  if (!triangles) return tl::unexpected(triangles.error());
  if (!hasBoundingBox(*triangles, structures.info.box_M)) {
    return fail(meshes.front().string() + ": is not the mesh of " + structures.info.source +
                ": it is of another size");
  }
  return structures::SurfaceTree(structures::outerTriangles(*triangles, structures.field));
}

}  // namespace tenon::bake
