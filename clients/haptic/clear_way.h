#pragma once

#include <span>

#include "idl/types/fixed_vector.h"
#include "idl/types/messages.h"

namespace tenon {

using Waypoints = FixedVector<Vector3, 4>;

/// How a person carries something past the big things of a scene: straight where nothing is in between, else
/// up, across above everything, and down.
///
/// She knows big things (objects drawn as `scene`) by their outline only, so what is inside one, such as a
/// pocket of an engine bay, is reached from above.
///
/// Threads: one. Real-time: plan.
class ClearWay {
 public:
  void begin(std::span<const SceneObject> objects);
  /// Points to pass, the last is `to`. Keeps `margin` away from the outlines.
  [[nodiscard]] Waypoints plan(const Vector3& from, const Vector3& to, double margin) const noexcept;

 private:
  struct Box {
    Vector3 low, high;
  };
  [[nodiscard]] static bool crosses(const Box& box, const Vector3& from, const Vector3& to,
                                    double margin) noexcept;
  FixedVector<Box, 8> boxes_;
};

}  // namespace tenon
