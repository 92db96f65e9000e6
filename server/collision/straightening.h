#pragma once

#include <span>

#include "server/collision/query_kernels.h"

namespace tenon {

/// Gives points inside, where a field bends, the distance and slope of a plane.
///
/// Interpolation rounds off what lies between its samples: in walls thinner than a few voxels and under edges
/// a depth comes out too small by up to half a voxel's diagonal, and the slope points anywhere. There the
/// distance is convex: it is not above its interpolation, and not below any plane that touches it. Such
/// planes are what the field says a little way off, where it does not bend. So of those on eight sides the
/// highest that is not above the interpolation is taken, with its slope, if a second side tells of the same
/// face or the field goes on like it outside, and if the slope is so much less than one that interpolation
/// may err by that. Nothing is done where the field is as straight as a distance should be, in concave
/// corners and about what is round.
///
/// Changes samples, sixteen points a block, of lanes inside the dilated surface; distances never rise.
///
/// Threads: pure. Real-time.
void straighten(const LaneFrame& frame, const QueryKernels& kernels, const PointLanes& points,
                std::span<SampleLanes> samples, SampleSums& sums) noexcept;

}  // namespace tenon
