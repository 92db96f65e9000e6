#pragma once

#include <span>

#include "server/collision/query_kernels.h"

namespace tenon::collision {

/// Ridge correction: replaces distance and gradient of points inside, near gradient discontinuities of the
/// field, by those of a tangent plane.
///
/// Trilinear interpolation rounds the distance off between samples. In walls thinner than a few voxels and
/// under edges the interpolated depth is too small by up to half a voxel diagonal, and the gradient is
/// arbitrary. There the distance is convex, so it lies between its interpolation (upper bound) and every
/// tangent plane (lower bound). Tangent planes come from eight probes around the point at which the gradient
/// is of unit length. The highest plane that does not exceed the interpolation is taken, if a second probe
/// sees the same face or the field continues along the plane outside, and if the gradient is so much shorter
/// than 1 that interpolation may err by the difference. Points where the gradient has unit length, in concave
/// corners and near round surfaces stay unchanged.
///
/// Changes the lanes of `samples` (blocks of sixteen points) that are inside the dilated surface, and
/// `sums.smallest_distance`; distances never increase.
///
/// Threads: pure. Real-time.
void correctRidges(const LaneFrame& frame, const QueryKernels& kernels, const PointLanes& points,
                   std::span<SampleLanes> samples, SampleSums& sums) noexcept;

/// Distance to the exact surface and gradient at P in the frame of the mesh: what a query that corrects
/// ridges has for a point there, without the dilation.
///
/// Threads: pure. Real-time.
[[nodiscard]] structures::FieldSample correctedSample(const structures::DistanceField& field,
                                                      const Vector3& p_MP) noexcept;

}  // namespace tenon::collision
