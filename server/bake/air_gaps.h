#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/brick_level.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// A coarse brick with air between two surfaces that face each other.
struct AirGap {
  std::uint32_t brick = 0;         ///< node of the coarse level
  double width = 0.0;              ///< [m] the least there
  Vector3 p_MP = Vector3::Zero();  ///< where it is least
};

/// The bricks with gaps (slots, between fins) from `narrowest` [m] to two coarse voxels wide, narrowest
/// first.
///
/// At a point of the surface the gap is as wide as the way along the normal to the next surface, provided
/// that it faces the point: not in a corner of more than 60 degrees. It is air when its middle is connected
/// with a sample outside by straight lines that no triangle intersects, directly or by way of other gaps.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] std::vector<AirGap> findAirGaps(const BrickLevel& coarse,
                                              std::span<const structures::Triangle> triangles,
                                              const TriangleTree& tree, double narrowest, ParallelWork& work);

}  // namespace tenon::bake
