#pragma once

#include <span>
#include <vector>

#include "server/structures/distance_field.h"
#include "server/structures/surface_tree.h"

namespace tenon::structures {

/// The parts of triangles that lie on the outer surface of the object they were baked from.
///
/// Overlapping solids contain walls that are not part of the surface of their union; `field` tells which. A
/// triangle that is partly interior is split along the border into pieces of a third of a voxel. Walls less
/// than a quarter of a voxel under the surface are kept.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] std::vector<SurfaceTree::Triangle> outerTriangles(
    std::span<const SurfaceTree::Triangle> triangles, const DistanceField& field);

}  // namespace tenon::structures
