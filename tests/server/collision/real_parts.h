#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/exact_distance.h"
#include "tests/support/shared_files.h"

namespace tenon::test {

/// A part of a CAD file: baked, and as the triangle mesh it was baked from.
struct RealPart {
  StructuresPtr structures;
  bake::TriangleMesh mesh;
  ExactDistance truth;  ///< distances to the mesh, for comparison
};

/// [voxels] Half a voxel's diagonal: the smallest dilation that keeps a sheet of zero thickness solid.
inline constexpr double kSolidVoxels = 0.87;
/// [m] Dilation for a clearance of `clearance` [m]: a quarter of it, so that the rest stays free for motion.
inline double dilationOf(double clearance) { return 0.25 * clearance; }
/// [m] Voxel size for a clearance of `clearance` [m].
inline double voxelOf(double clearance) { return dilationOf(clearance) / kSolidVoxels; }

inline std::filesystem::path pairsFolder() { return dataFolder() / "pairs"; }

/// Bakes a part: voxels of `fine` [m] within the boxes, eight times as large elsewhere, points `spacing` [m]
/// apart. On an error it adds a test failure and returns null.
inline std::unique_ptr<const RealPart> bakePart(const std::string& file, double fine,
                                                const std::vector<Eigen::AlignedBox3d>& boxes_M,
                                                double spacing) {
  const auto mesh = bake::importMesh(pairsFolder() / file, 1.0);
  if (!mesh) {
    ADD_FAILURE() << mesh.error().what;
    return nullptr;
  }
  bake::BakeOptions options;
  options.refinement = 8;
  options.voxel = options.refinement * fine;
  options.point_spacing = spacing;
  for (const Eigen::AlignedBox3d& box_M : boxes_M) options.refine.push_back({box_M});
  auto baked = bake::bake(*mesh, options);
  if (!baked) {
    ADD_FAILURE() << baked.error().what;
    return nullptr;
  }
  return std::make_unique<const RealPart>(
      RealPart{std::make_shared<const structures::HapticStructures>(std::move(*baked)), *mesh,
               ExactDistance(mesh->vertices, mesh->triangles)});
}

/// A box about the line along z through (`x` [m], 0): `half` [m] to each side, z in `from` [m] to `to` [m].
inline Eigen::AlignedBox3d boxAboutAxis(double x, double half, double from, double to) {
  return {Vector3(x - half, -half, from), Vector3(x + half, half, to)};
}

/// [m] Largest depth of A's points and vertices in B's mesh; 0 when it is not above `noise` [m].
inline double depthInMesh(const RealPart& a, const RealPart& b, const Pose& X_BA, double noise) {
  constexpr double kNear = 1e-4;  // [m] field distance above which the exact distance is not computed
  double deepest = 0.0;
  const auto check = [&](const Vector3& p_AP) {
    const Vector3 p_BP = X_BA * p_AP;
    const structures::DistanceField& field = b.structures->field;
    if (field.lowerBound(p_BP) > kNear || field.sample(p_BP).distance > kNear) return;
    const ExactDistance::Nearest nearest = b.truth.nearest(p_BP);
    if (nearest.distance <= std::max(noise, deepest)) return;
    const auto& [i, j, k] = b.mesh.triangles[nearest.triangle];
    const auto corner = [&b](std::uint32_t v) { return Vector3(b.mesh.vertices[v].cast<double>()); };
    const Vector3 outward = (corner(j) - corner(i)).cross(corner(k) - corner(i));
    if (outward.dot(p_BP - nearest.p_MQ) < 0.0 && b.truth.inside(p_BP)) deepest = nearest.distance;
  };
  for (const structures::ShellPoint& point : a.structures->shell.points()) check(point.p_MP.cast<double>());
  for (const Vector3f& vertex : a.mesh.vertices) check(vertex.cast<double>());
  return deepest;
}

/// [m] Larger of depthInMesh in both directions; 0 when not above `noise` [m].
inline double overlapOfMeshes(const RealPart& a, const RealPart& b, const Pose& X_BA, double noise) {
  return std::max(depthInMesh(a, b, X_BA, noise), depthInMesh(b, a, X_BA.inverse(), noise));
}

}  // namespace tenon::test
