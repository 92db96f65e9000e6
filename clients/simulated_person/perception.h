#pragma once

#include <cstdint>
#include <vector>

#include "clients/haptic/world_view.h"

namespace tenon::simulated_person {

/// What a simulated person perceives of one hand (without delay): its pose, the object it moves, the wrench
/// displayed on it.
struct HandPerception {
  HandId hand;
  Pose X_WH;
  Wrench F_Ho_W;    ///< displayed on the hand by the device, about the hand's origin
  ObjectId object;  ///< moved by the hand; invalid until the server has sent a manifold
  Pose X_HO;
  Vector3 p_WC = Vector3::Zero();  ///< centre of the device's workspace
  double reach = 0.3;              ///< [m] radius about C within which the hand may be
  bool declutches = false;         ///< the device has a button that de-clutches it
  bool indexing = false;           ///< C moves
};

/// Visual perception with a reaction delay: object poses as they were `delay_ticks` ago, otherwise exact, of
/// hidden objects too.
///
/// Threads: one. Real-time: everything but begin().
class DelayedPerception {
 public:
  /// `objects`: number of objects; `delay_ticks`: reaction time, at least 1 is used.
  void begin(std::size_t objects, unsigned delay_ticks);
  /// Records the poses of this tick; call once per millisecond. Until the first delay has passed pose()
  /// returns those of the first call.
  void record(const haptic::WorldView& world) noexcept;
  [[nodiscard]] bool knows(ObjectId object) const noexcept { return object.value < objects_; }
  /// X_WO, delayed. `knows(object)` must hold.
  [[nodiscard]] const Pose& pose(ObjectId object) const noexcept;

 private:
  std::vector<Pose> history_;  // ring of delay_ scenes with objects_ poses each
  std::size_t objects_ = 0;
  std::size_t delay_ = 1;    // [ticks]
  std::size_t records_ = 0;  // calls of record()
};

}  // namespace tenon::simulated_person
