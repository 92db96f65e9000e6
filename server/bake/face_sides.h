#pragma once

#include <array>
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
  /// `edges`: WeldedMesh::edges().
  FaceSides(const WeldedMesh& mesh, const std::vector<WeldedMesh::Edge>& edges,
            const structures::DistanceField& field);

  /// Unit normal of a triangle, outwards; zero where it has no side.
  [[nodiscard]] Vector3 outward(std::uint32_t triangle) const;

 private:
  /// A triangle beside another one.
  struct Neighbour {
    std::uint32_t triangle = WeldedMesh::Edge::kNone;
    std::int8_t same = 0;  ///< 1: it has the other's orientation; -1: the opposite one
  };
  using Neighbours = std::vector<std::array<Neighbour, 3>>;  ///< of each triangle

  [[nodiscard]] Neighbours neighboursOf(const std::vector<WeldedMesh::Edge>& edges) const;
  /// Gives all triangles that are joined with `seed` one orientation, in sign_, and lists them in `patch`.
  /// False when they have none.
  bool orient(const Neighbours& neighbours, std::uint32_t seed, std::vector<std::uint32_t>& patch);
  /// Decides on which side the oriented patch is outside.
  void decide(const std::vector<std::uint32_t>& patch, bool orientable,
              const structures::DistanceField& field);

  const WeldedMesh& mesh_;
  std::vector<std::int8_t> sign_;  ///< of (t[1] - t[0]) x (t[2] - t[0]); 0: no side
};

}  // namespace tenon::bake
