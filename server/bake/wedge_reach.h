#pragma once

#include <array>

#include "idl/types/spatial.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

/// A piece of a convex edge: its ends are at centre +- half [m]. `into` as structures::FeatureEdge; `skew`
/// [-] of the planes at -half and +half: a point at r from the edge is at the end of the piece where it is
/// skew . r before the end of the edge.
struct WedgePiece {
  Vector3 centre, half;
  std::array<Vector3, 2> into;
  std::array<Vector3, 2> skew{Vector3::Zero(), Vector3::Zero()};
};

/// How far from a piece of a convex edge the surface is nothing but the edge's two faces.
///
/// Within that distance, and between the ends of the piece, the solid is exactly the wedge between the planes
/// of its faces. Other surfaces end it: the far side of a plate, the next edge of a chamfer, another part.
///
/// Threads: constant. Real-time: no; used while structures are baked.
class WedgeReach {
 public:
  /// `tree` of the surface.
  explicit WedgeReach(const TriangleTree& tree) : tree_(tree) {}

  /// [m] Distance from the line of the piece to the nearest surface between its ends that is in neither of
  /// the two planes, at most `most` [m]. Faces that are farther than `tolerance` [m] from a plane are not in
  /// it. 0 where the faces are less than 6 degrees apart: sheets have no wedge.
  [[nodiscard]] double of(const WedgePiece& piece, double most, double tolerance) const;

 private:
  const TriangleTree& tree_;
};

}  // namespace tenon::bake
