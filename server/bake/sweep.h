#pragma once

#include <span>

#include "server/bake/bake.h"
#include "server/bake/voxel_set.h"

namespace tenon::bake {

// A path is a list of poses X_WM of a body, with linear translation of the body's centre and rotation at
// constant angular velocity between them. Threads: any; `progress` is called on the caller's. Real-time: no.

struct SweepOptions {
  double cell = 0.005;    ///< [m] edge of the cells
  double dilation = 0.0;  ///< [m] offset of the body's surface, at most the band of its field
};

/// The swept volume: the cells that the body fills at some pose of the path, sampled so that no point moves
/// more than half a cell per step. An error when a number is out of range, the body has no field, the path
/// has no pose or more than 2 million steps, the cells do not fit into memory, or `progress` cancels.
[[nodiscard]] Result<VoxelSet> sweep(const structures::HapticStructures& moved,
                                     std::span<const Pose> poses_WM, const SweepOptions& options,
                                     const BakeProgress& progress = {});

/// The smallest distance of a body to a scene along a path.
struct Clearance {
  double distance = 0.0;  ///< [m] of the nearest shell point; < 0: penetration
  bool exact = false;     ///< false: outside the scene's band; |distance| is then a lower bound
  std::size_t pose = 0;   ///< number of the pose at which, or after which, it occurs
  Vector3 p_WP = Vector3::Zero();
};

/// The smallest distance of the body's shell points to a scene at rest in W, along a path in which no point
/// moves more than `step` [m] per sample. An error when `step` is not above 0, the body has no shell, the
/// scene no field, the path no pose or more than 2 million steps, or `progress` cancels.
[[nodiscard]] Result<Clearance> clearance(const structures::HapticStructures& moved,
                                          std::span<const Pose> poses_WM,
                                          const structures::DistanceField& scene_W, double step,
                                          const BakeProgress& progress = {});

}  // namespace tenon::bake
