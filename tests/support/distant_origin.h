#pragma once

#include "tests/support/analytic_structures.h"

namespace tenon::test {

/// A box of `size` [m] whose mesh has its origin far away: the centre of the box is at p_OC_O [m].
inline StructuresPtr boxStructuresAt(const Vector3& p_OC_O, const Vector3& size, double voxel,
                                     double spacing) {
  std::vector<structures::SurfaceSample> samples = boxSamples(size, spacing);
  for (structures::SurfaceSample& sample : samples) sample.p_MP += p_OC_O;
  return analyticStructures(movedDistance(boxDistance(size), Pose(p_OC_O)),
                            {p_OC_O - 0.5 * size, p_OC_O + 0.5 * size}, voxel, samples, spacing);
}

}  // namespace tenon::test
