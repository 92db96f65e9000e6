#pragma once

#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/messages/objects.h"

namespace tenon::simulated_person {

/// Positions in W, in the order in which they are passed; the last is the goal.
using Waypoints = FixedVector<Vector3, 4>;

/// Plans the path along which a simulated person carries an object past the obstacles of a scene: straight
/// where the segment is free, else up, across above them, and down.
///
/// Obstacles are the axis-aligned bounding boxes (in W) of objects of kind `scene`; a goal inside a box, such
/// as a pocket of an engine bay, is reached from above.
///
/// Threads: one. Real-time: plan.
class PathPlanner {
 public:
  /// Takes the bounding boxes of the first 8 objects of kind `scene`.
  void begin(std::span<const SceneObject> objects);
  /// Waypoints from `from` to `to` (both in W), without `from` itself; keeps `margin` [m] away from the
  /// boxes.
  [[nodiscard]] Waypoints plan(const Vector3& from, const Vector3& to, double margin) const noexcept;

 private:
  /// Bounding box in W.
  struct Obstacle {
    Vector3 low, high;
  };
  /// The segment passes through the box grown by `margin` [m].
  [[nodiscard]] static bool intersects(const Obstacle& box, const Vector3& from, const Vector3& to,
                                       double margin) noexcept;
  FixedVector<Obstacle, 8> obstacles_;
};

}  // namespace tenon::simulated_person
