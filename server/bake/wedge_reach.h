#pragma once

#include <array>

#include "idl/types/spatial.h"
#include "server/bake/triangle_tree.h"

namespace tenon::bake {

/// How far from a piece of a convex edge the surface is nothing but the edge's two faces.
///
/// Within that distance, and between the ends of the piece, the solid is exactly the wedge between the planes
/// of its faces. Other surfaces end it: the far side of a plate, the next edge of a chamfer, another part.
///
/// Threads: constant. Real-time: no; used while structures are baked.
class WedgeReach {
 public:
  /// `tree` of the surface. Faces that are farther than `tolerance` [m] from a plane are not in it.
  WedgeReach(const TriangleTree& tree, double tolerance) : tree_(tree), tolerance_(tolerance) {}

  /// [m] Distance from the line of the piece centre +- half to the nearest surface between its ends that is
  /// in neither of the two planes, at most `most` [m]. `into` as structures::FeatureEdge. 0 where the faces
  /// are less than 6 degrees apart: sheets have no wedge.
  [[nodiscard]] double of(const Vector3& centre, const Vector3& half, const std::array<Vector3, 2>& into,
                          double most) const;

 private:
  const TriangleTree& tree_;
  double tolerance_;  ///< [m]
};

}  // namespace tenon::bake
