#pragma once

#include <cmath>

#include "server/collision/query_kernels.h"

namespace tenon::collision {

/// [-] Of the squared length of a gradient: quantised samples alone cause less.
inline constexpr double kUnitSlope = 0.005;

/// Valley correction: distance and gradient at a point near a concave edge or corner of the field's surface.
///
/// Where faces enclose free space by less than 180 degrees, the distance there is the smallest one of those
/// to their planes. Trilinear interpolation rounds it off and is too small by up to a third of a voxel: an
/// edge that fits the corner exactly stands off, and a taper ahead of its seat by that over its slope.
///
/// Where the bake has found the planes (DistanceField::planesAt), the distance is that to the nearest of
/// them: exact, in any orientation of the edge in the grid. A point behind several has the distance to the
/// one that it is farthest behind.
///
/// Elsewhere planes come from eight probes around the point at which the gradient is of unit length
/// (tangent_probes.h). Up to four of them make a field: the distance to the space outside of all. Where the
/// eight samples of the point's cell are those of this field, the error is subtracted that interpolation has
/// in it, and the gradient is that of the plane with the smallest distance. Everywhere else nothing changes:
/// beside convex edges, in front of curved faces, in walls thinner than a few voxels, where a dilation
/// changes. So a wall that the samples have is not opened. Distances decrease by rounding at most.
///
/// True when `sample`, which is of P, has changed. Threads: pure. Real-time.
bool correctValley(const LaneFrame& frame, const QueryKernels& kernels, const Vector3& p_BP,
                   structures::FieldSample& sample) noexcept;

/// Whether a sample, of `distance` [m] and with a gradient of squared length `gradient2` [-], may be one of a
/// valley, near the surface; others need no correctValley().
[[nodiscard]] inline bool mayBeInValley(const structures::DistanceField& field, double distance,
                                        double gradient2) {
  if (!(distance < field.voxel() && distance > -field.voxel())) return false;
  return field.hasPlanes() || std::abs(gradient2 - 1.0) > kUnitSlope;
}

/// DistanceField::sample with this correction.
///
/// Threads: pure. Real-time.
[[nodiscard]] structures::FieldSample sampleInValley(const structures::DistanceField& field,
                                                     const Vector3& p_MP) noexcept;

}  // namespace tenon::collision
