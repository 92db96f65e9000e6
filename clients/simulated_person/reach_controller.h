#pragma once

#include "idl/types/spatial.h"

namespace tenon::simulated_person {

/// Moves a simulated hand to a goal pose: proportional velocity command, saturated, then low-pass filtered
/// twice (first order each).
///
/// The result approximates the bell-shaped speed profile of human reaching (minimum jerk; Flash and Hogan
/// 1985), but, unlike a minimum-jerk trajectory, needs neither the duration nor a goal that stays where it
/// is.
///
/// Threads: one. Real-time: everything.
class ReachController {
 public:
  /// At rest at X_WH.
  void start(const Pose& X_WH) noexcept;
  /// Advances by `dt` [s] towards the goal X_WG; the command is at most `max_speed` [m/s] and
  /// `max_turn_speed` [rad/s].
  void step(const Pose& X_WG, double max_speed, double max_turn_speed, double dt) noexcept;
  /// Projects the hand onto the ball of `radius` [m] about p_WC; returns whether it was outside.
  bool stayWithin(const Vector3& p_WC, double radius) noexcept;

  [[nodiscard]] const Pose& pose() const noexcept { return X_WH_; }
  /// Of the hand, in W.
  [[nodiscard]] const Twist& velocity() const noexcept { return velocity_; }

 private:
  Pose X_WH_;
  Twist velocity_;
  Twist filtered_once_;  // output of the first of the two filter stages
};

}  // namespace tenon::simulated_person
