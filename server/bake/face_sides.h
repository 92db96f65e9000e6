#pragma once

#include <cstdint>
#include <vector>

#include "server/bake/welded_mesh.h"
#include "server/structures/distance_field.h"

namespace tenon::bake {

/// Which side of each triangle is outside.
///
/// Triangles that share edges have one orientation; the field decides by a majority of their area which one.
/// So a stud much thinner than a voxel has the sides of the part it stands on. Where triangles have no common
/// orientation, or the field sees no inside (a sheet), a triangle has no side.
///
/// Threads: constant after construction. Real-time: no; used while structures are baked.
class FaceSides {
 public:
  /// `edges`: all edges of the mesh with one or two triangles.
  FaceSides(const WeldedMesh& mesh, const std::vector<WeldedMesh::Edge>& edges,
            const structures::DistanceField& field);

  /// Unit normal of a triangle, outwards; zero where it has no side.
  [[nodiscard]] Vector3 outward(std::uint32_t triangle) const;

 private:
  const WeldedMesh& mesh_;
  std::vector<std::int8_t> sign_;  ///< of (t[1] - t[0]) x (t[2] - t[0]); 0: no side
};

}  // namespace tenon::bake
