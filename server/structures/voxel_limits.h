#pragma once

namespace tenon::structures {

/// The voxels that a scenario or a command line may ask for: beyond these a unit is missing or wrong.
inline constexpr double kSmallestVoxel = 2e-5;  ///< [m]
inline constexpr double kLargestVoxel = 0.1;    ///< [m]

}  // namespace tenon::structures
