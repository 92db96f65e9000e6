#pragma once

#include <span>
#include <vector>

#include "server/bake/thin_bricks.h"
#include "server/structures/distance_field.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

class ParallelWork;

/// Where material is too thin for the voxels there.
struct ThinPlaces {
  std::vector<float> dilations;  ///< [m] as DistanceField::Layout::dilations; 0 at solids
  double area = 0.0;             ///< [m^2] of the surface there
  double open_area = 0.0;        ///< [m^2] of it that the dilation leaves outside of the zero level set
};

/// Measures `field`, which has no dilation, at points of the exact `surface`.
///
/// Sampled more coarsely than it is thick, a wall loses its inside: the interpolated distance is positive at
/// its exact surface, or zero where that is in a plane of samples. Each coarse brick gets the dilation that
/// makes the zero level set as flat as the thinnest wall in it (see dilationFor in the .cpp); a corner gets
/// the largest of its eight bricks. It changes by at most 0.2 mm a mm. A point whose neighbourhood has an
/// inside, or whose wall's two faces are not parallel and have an inside between them, is at a convex edge of
/// a solid and does not count: offset surfaces are for sheets alone (Xu and Barbic 2014). Only coarse bricks
/// marked in `thin` are measured.
[[nodiscard]] ThinPlaces findThinPlaces(const structures::DistanceField& field,
                                        std::span<const structures::Triangle> surface, const BrickMarks& thin,
                                        ParallelWork& work);

}  // namespace tenon::bake
