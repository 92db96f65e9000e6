#pragma once

#include <span>
#include <vector>

#include "server/structures/distance_field.h"
#include "server/structures/surface_tree.h"

namespace tenon {

/// Of triangles that were baked into a field, what the outside touches, as the field tells: overlapping
/// solids have walls inside each other which are no surface of the whole. What reaches inside is cut into
/// pieces of a third of a voxel along the border; walls less than a quarter of a voxel under the surface
/// stay.
[[nodiscard]] std::vector<SurfaceTree::Triangle> outerTriangles(
    std::span<const SurfaceTree::Triangle> triangles, const DistanceField& field);

}  // namespace tenon
