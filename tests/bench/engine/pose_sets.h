#pragma once

#include <cstddef>
#include <vector>

#include "idl/types/spatial.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon::bench {

/// Poses X_BA of a shell's body in a field's body, as hands make them: the same for the same structures, on
/// every machine. Neighbours in a list lie near each other, as from one tick to the next.
struct PoseSets {
  std::vector<Pose> free;     ///< nothing nearer than 15 mm
  std::vector<Pose> near;     ///< apart, by at most 15 mm
  std::vector<Pose> contact;  ///< pressed in, 0.5 to 5 mm deep
};

/// A body is led to its place in another.
struct Insertion {
  Pose X_BT;                                ///< where it belongs
  Vector3 direction_B = -Vector3::UnitZ();  ///< unit, the way in
  double reach = 0.20;                      ///< [m] it begins so far before its place
  double astray = 0.06;                     ///< [m] sideways at first, less from pose to pose
};

/// Of about `count` poses a third is of each kind. The body sways towards its place on a spiral, tilted by up
/// to 3 degrees, and is pushed in from there along the direction until it is as deep as wanted.
[[nodiscard]] PoseSets insertionPoses(const Pointshell& shell_A, const DistanceField& field_B,
                                      const Insertion& insertion, std::size_t count);

}  // namespace tenon::bench
