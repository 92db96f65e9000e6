#pragma once

#include "idl/types/spatial.h"

namespace tenon {

/// How a person's hand goes somewhere: speeds up and slows down gently, never faster than she likes.
///
/// A speed that is proportional to the way left, capped, and smoothed twice: the bell-shaped speed of human
/// reaching (minimum jerk; Flash and Hogan 1985) without its need to know the goal in advance.
///
/// Threads: one. Real-time: everything.
class SmoothReach {
 public:
  void start(const Pose& X_WH) noexcept;
  void step(const Pose& X_WG, double max_speed, double max_turn_speed, double dt) noexcept;
  /// Holds the hand within `reach` of the centre p_WC: an arm's length.
  void stayWithin(const Vector3& p_WC, double reach) noexcept;

  [[nodiscard]] const Pose& pose() const noexcept { return X_WH_; }
  [[nodiscard]] const Twist& velocity() const noexcept { return velocity_; }

 private:
  Pose X_WH_;
  Twist velocity_;
  Twist push_;  // the first smoothing stage
};

}  // namespace tenon
