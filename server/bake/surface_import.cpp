#include "server/bake/surface_import.h"

#include <string>
#include <utility>

#include "server/bake/bake.h"
#include "server/structures/outer_surface.h"

namespace tenon {

namespace {

using SurfaceTriangle = SurfaceTree::Triangle;

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

bool fills(const std::vector<SurfaceTriangle>& triangles, const Eigen::AlignedBox3d& wanted) {
  Eigen::AlignedBox3d box;
  for (const SurfaceTriangle& corners : triangles) {
    for (const Vector3f& corner : corners) box.extend(corner.cast<double>());
  }
  const double most = 1e-4 * wanted.diagonal().norm();
  return (box.min() - wanted.min()).norm() <= most && (box.max() - wanted.max()).norm() <= most;
}

}  // namespace

Result<SurfaceTree> importSurface(const HapticStructures& structures,
                                  std::vector<std::filesystem::path> meshes) {
  if (meshes.empty()) meshes = structures.info.meshes;
  if (meshes.empty()) return fail(structures.info.source + ": nothing tells where its mesh is");
  const auto triangles = trianglesOf(meshes, structures.info.unit);
  if (!triangles) return tl::unexpected(triangles.error());
  if (!fills(*triangles, structures.info.box_M)) {
    return fail(meshes.front().string() + ": is not the mesh of " + structures.info.source +
                ": it is of another size");
  }
  return SurfaceTree(outerTriangles(*triangles, structures.field));
}

}  // namespace tenon
