#pragma once

#include <span>

#include "server/bake/bake.h"
#include "server/bake/voxel_set.h"

namespace tenon {

/// What a body passes through on its way from pose to pose: straight lines and even turns between them.
struct SweepOptions {
  double cell = 0.005;  ///< [m]
  double grow = 0.0;    ///< [m] added all round
};

/// The cells a solid fills at some pose X_WM of the way, which is walked in steps of at most half a cell.
[[nodiscard]] Result<VoxelSet> sweep(const HapticStructures& moved, std::span<const Pose> poses_WM,
                                     const SweepOptions& options, const BakeProgress& progress = {});

/// How near a body comes to a scene on its way.
struct Clearance {
  double distance = 0.0;  ///< [m] of the nearest shell point; < 0: so deep
  bool exact = false;     ///< false: outside the scene's band, and `distance` is a bound nearer to 0
  std::size_t pose = 0;   ///< the pose before or at the nearest place
  Vector3 p_WP = Vector3::Zero();
};

/// The least distance of the body's shell points to a scene at rest in W, on the same way in steps of at most
/// `step` [m].
[[nodiscard]] Result<Clearance> clearance(const HapticStructures& moved, std::span<const Pose> poses_WM,
                                          const DistanceField& scene_W, double step,
                                          const BakeProgress& progress = {});

}  // namespace tenon
