#pragma once

#include <cstdint>
#include <vector>

#include "clients/haptic/world_view.h"
#include "idl/types/messages.h"

namespace tenon {

/// What a person knows of one of her hands: where it is, what it holds and what it feels.
struct HandSense {
  HandId hand;
  Pose X_WH;
  Wrench F_Ho_W;    ///< displayed on the hand
  ObjectId object;  ///< what it moves; none before the server said so
  Pose X_HO;
  Vector3 p_WC = Vector3::Zero();  ///< where the middle of the arm's reach is
  double reach = 0.3;              ///< [m] the arm gets from there
};

/// Seeing takes time: where each object was a reaction ago.
///
/// Threads: one. Real-time: everything but begin().
class DelayedSight {
 public:
  void begin(std::size_t objects, unsigned delay_ticks);
  /// Once a millisecond.
  void look(const WorldView& world) noexcept;
  [[nodiscard]] bool knows(ObjectId object) const noexcept { return object.value < objects_; }
  [[nodiscard]] const Pose& pose(ObjectId object) const noexcept;

 private:
  std::vector<Pose> seen_;  // a ring of scenes
  std::size_t objects_ = 0;
  std::size_t delay_ = 1;
  std::size_t looks_ = 0;
};

}  // namespace tenon
