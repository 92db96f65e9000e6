#pragma once

#include "server/collision/query_kernels.h"

namespace tenon::collision {

/// Valley correction: distance and gradient at a point near a concave edge or corner of the field's surface.
///
/// Where faces enclose free space by less than 180 degrees, the distance there is the smallest one of those
/// to their planes. Trilinear interpolation rounds it off and is too small by up to a third of a voxel: an
/// edge that fits the corner exactly stands off, and a taper ahead of its seat by that over its slope.
///
/// Planes come from eight probes around the point at which the gradient is of unit length (tangent_probes.h).
/// Up to four of them make a field: the distance to the space outside of all. Where the eight samples of the
/// point's cell are those of this field, the error is subtracted that interpolation has in it, and the
/// gradient is that of the plane with the smallest distance. Everywhere else nothing changes: beside convex
/// edges, in front of curved faces, in walls thinner than a few voxels, where a dilation changes. So a wall
/// that the samples have is not opened. Distances never decrease.
///
/// True when `sample`, which is of P, has changed. Threads: pure. Real-time.
bool correctValley(const LaneFrame& frame, const QueryKernels& kernels, const Vector3& p_BP,
                   structures::FieldSample& sample) noexcept;

/// Whether a sample, of `distance` [m] and with a gradient of squared length `gradient2` [-], may be one of a
/// valley, near the surface; others need no correctValley(). `voxel` [m] is the field's largest.
[[nodiscard]] inline bool mayBeInValley(double distance, double gradient2, double voxel) {
  constexpr double kUnitTolerance = 0.005;  // [-] quantised samples alone cause less
  return distance < voxel && distance > -voxel &&
         (gradient2 < 1.0 - kUnitTolerance || gradient2 > 1.0 + kUnitTolerance);
}

/// DistanceField::sample with this correction.
///
/// Threads: pure. Real-time.
[[nodiscard]] structures::FieldSample sampleInValley(const structures::DistanceField& field,
                                                     const Vector3& p_MP) noexcept;

}  // namespace tenon::collision
