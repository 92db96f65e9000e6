#pragma once

#include <cstddef>
#include <vector>

#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon::bench {

/// Poses X_BA of the pointshell's body A in the field's body B, as in manual insertion. Deterministic for
/// given structures. Consecutive poses of a list are close to each other, as from tick to tick.
struct PoseSets {
  std::vector<Pose> free;     ///< gap of at least 15 mm
  std::vector<Pose> near;     ///< gap of at most 15 mm
  std::vector<Pose> contact;  ///< penetrating, 0.5 to 5 mm deep
};

/// Path of a body to its target pose in another.
struct InsertionTask {
  Pose X_BT;                                ///< target pose
  Vector3 direction_B = -Vector3::UnitZ();  ///< unit, direction of insertion
  double reach = 0.20;                      ///< [m] distance of the start from the target
  double lateral_offset = 0.06;             ///< [m] sideways at the start, decreasing to 0
};

/// About `count` / 3 poses of each kind, fewer where a kind is not reached. The start poses are on a spiral
/// around the direction of insertion, tilted by up to 3 degrees; from there the body moves along the
/// direction until it has the wanted gap or depth.
[[nodiscard]] PoseSets insertionPoses(const structures::Pointshell& shell_A,
                                      const structures::DistanceField& field_B,
                                      const InsertionTask& insertion, std::size_t count);

}  // namespace tenon::bench
