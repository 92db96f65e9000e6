#pragma once

#include <vector>

#include "server/structures/field_builder.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// The planes of the surface in cells where it is concave and flat: at concave edges, in corners and in
/// narrow slots. Each is the plane of a triangle of `surface`, and together they are the field there: at 27
/// points of the cell the distance to their outside is that to the mesh, to a hundredth of a voxel, with the
/// sign that samples away from the surface have. Round surfaces, convex edges, thin walls and cells in which
/// interpolation is as good have none.
///
/// `field` is the finished one, `surface` its exposed triangles. `mesh` has all triangles, null where these
/// are the same: at concave edges that no sample is near, pieces of the surface count as hidden. The result
/// has the bricks in ascending order.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] std::vector<structures::BrickValleys> findValleys(const structures::DistanceField& field,
                                                                const TriangleTree& surface,
                                                                const TriangleTree* mesh, ParallelWork& work);

}  // namespace tenon::bake
