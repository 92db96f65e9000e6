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

/// A part of a CAD file: baked, and as the triangles it came from.
struct RealPart {
  StructuresPtr structures;
  TriangleMesh mesh;
  ExactDistance truth;
};

/// By DESIGN's rule: what keeps a sheet solid is at most a quarter of the play, and at least this many
/// voxels.
inline constexpr double kSolidVoxels = 0.87;
inline double dilationOf(double play) { return 0.25 * play; }
inline double voxelOf(double play) { return dilationOf(play) / kSolidVoxels; }

inline std::filesystem::path pairsFolder() { return sharedFolder() / "cad" / "pairs"; }

/// Voxels of `fine` within the boxes, eight times as large elsewhere. Null after a failure that it reports.
inline std::unique_ptr<const RealPart> bakePart(const std::string& file, double fine,
                                                const std::vector<Eigen::AlignedBox3d>& boxes_M,
                                                double spacing) {
  const auto mesh = importMesh(pairsFolder() / file, 1.0);
  if (!mesh) {
    ADD_FAILURE() << mesh.error().what;
    return nullptr;
  }
  BakeOptions options;
  options.refinement = 8;
  options.voxel = options.refinement * fine;
  options.point_spacing = spacing;
  for (const Eigen::AlignedBox3d& box_M : boxes_M) options.refine.push_back({box_M});
  auto baked = bake(*mesh, options);
  if (!baked) {
    ADD_FAILURE() << baked.error().what;
    return nullptr;
  }
  return std::make_unique<const RealPart>(
      RealPart{std::make_shared<const HapticStructures>(std::move(*baked)), *mesh,
               ExactDistance(mesh->vertices, mesh->triangles)});
}

/// A box about the axis along z through (x, 0).
inline Eigen::AlignedBox3d boxAboutAxis(double x, double half, double from, double to) {
  return {Vector3(x - half, -half, from), Vector3(x + half, half, to)};
}

/// [m] How far a point of A's shell or a corner of A's mesh is inside B's mesh; 0 up to `noise`.
inline double depthInMesh(const RealPart& a, const RealPart& b, const Pose& X_BA, double noise) {
  constexpr double kNear = 1e-4;  // of the field, which only tells what is worth asking
  double deepest = 0.0;
  const auto ask = [&](const Vector3& p_AP) {
    const Vector3 p_BP = X_BA * p_AP;
    const DistanceField& field = b.structures->field;
    if (field.lowerBound(p_BP) > kNear || field.sample(p_BP).distance > kNear) return;
    const ExactDistance::Nearest nearest = b.truth.nearest(p_BP);
    if (nearest.distance <= std::max(noise, deepest)) return;
    const auto& [i, j, k] = b.mesh.triangles[nearest.triangle];
    const auto corner = [&b](std::uint32_t v) { return Vector3(b.mesh.vertices[v].cast<double>()); };
    const Vector3 outward = (corner(j) - corner(i)).cross(corner(k) - corner(i));
    if (outward.dot(p_BP - nearest.p_MQ) < 0.0 && b.truth.inside(p_BP)) deepest = nearest.distance;
  };
  for (const ShellPoint& point : a.structures->shell.points()) ask(point.p_MP.cast<double>());
  for (const Vector3f& vertex : a.mesh.vertices) ask(vertex.cast<double>());
  return deepest;
}

/// Both ways.
inline double overlapOfMeshes(const RealPart& a, const RealPart& b, const Pose& X_BA, double noise) {
  return std::max(depthInMesh(a, b, X_BA, noise), depthInMesh(b, a, X_BA.inverse(), noise));
}

}  // namespace tenon::test
