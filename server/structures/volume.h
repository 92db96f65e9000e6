#pragma once

#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"

namespace tenon {

/// What a distance field says about the material it encloses.
struct Volume {
  double volume = 0.0;                    ///< [m^3]; 0 when the field has no inside
  Vector3 p_MC_M = Vector3::Zero();       ///< its centre
  Matrix3 inertia_C_M = Matrix3::Zero();  ///< [m^5] about the centre: kg m^2 of a density of 1 kg/m^3
};

/// Sums the field's inside voxel by voxel; a voxel that the surface cuts counts by how deep its centre is. So
/// sums are exact for flat sides along the grid, and good to a part in a thousand for solids of twenty
/// voxels.
///
/// Threads: pure. Real-time: no, it visits every brick.
[[nodiscard]] Volume volumeOf(const DistanceField& field);

}  // namespace tenon
