#pragma once

#include <cstddef>
#include <vector>

#include "idl/types/spatial.h"
#include "server/bake/bake.h"
#include "server/structures/distance_field.h"
#include "tests/support/solid_union.h"

namespace tenon::bench {

/// Poses X_BA of a mesh A in the solids B, as in manual insertion, chosen by exact distances of A's vertices,
/// of which the field of B gives its dilation alone. Deterministic. Consecutive poses of a list are close to
/// each other, as from tick to tick.
struct PoseSets {
  std::vector<Pose> free;      ///< at least 15 mm apart
  std::vector<Pose> near;      ///< at most 15 mm apart, but outside of the dilated surface
  std::vector<Pose> touching;  ///< at most 0.1 mm inside the dilated surface: where ticks hold a part
  std::vector<Pose> pressed;   ///< 0.5 to 5 mm deep in the solids
};

/// Path of a body to its target pose in another.
struct InsertionTask {
  Pose X_BT;                                ///< target pose
  Vector3 direction_B = -Vector3::UnitZ();  ///< unit, direction of insertion
  double reach = 0.10;                      ///< [m] distance of the start from the target
  double lateral_offset = 0.04;             ///< [m] sideways at the start, decreasing to 0
};

/// [m] What A may cover on its path, in B.
[[nodiscard]] Eigen::AlignedBox3d regionOf(const bake::TriangleMesh& mesh_A, const InsertionTask& task);

/// At most `count` poses of each kind, fewer where a kind is not reached. The start poses are on a spiral
/// around the direction of insertion, tilted by up to 3 degrees; from there the body moves along the
/// direction until it has the wanted gap or depth. `field_B`: for its dilation.
[[nodiscard]] PoseSets insertionPoses(const bake::TriangleMesh& mesh_A, const test::SolidUnion& truth_B,
                                      const structures::DistanceField& field_B, const InsertionTask& task,
                                      std::size_t count);

}  // namespace tenon::bench
