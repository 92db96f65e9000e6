#pragma once

#include "idl/types/spatial.h"

namespace tenon::haptic {

/// Parameters of indexing; radius and gain come from DeviceCaps.
struct WorkspaceOptions {
  double radius = 0.2;         ///< [m] r_w of paper eq. 1
  double gain = 1.5;           ///< [1/s] lambda_w of paper eq. 1
  double move_speed = 0.4;     ///< [m/s] peak speed of moveTo()
  unsigned settle_ticks = 50;  ///< [ticks] without contact before the workspace moves again
  double return_gain = 1.0;    ///< [1/s] at which what shift() added decays
  double return_speed = 0.05;  ///< [m/s] at most
};

/// Position of the device's centre in the scene: C_w of the paper (§4.3).
///
/// Indexing by eq. 1 moves it while the hand is outside the sphere of radius r_w; moveTo() moves it to a
/// given position on a minimum-jerk path. Both pause while the hand's object is in contact, because a contact
/// would move with the workspace; stepDeclutched() moves it there too, since it leaves the hand in place. The
/// axes of D are parallel to W; the scale is 1.
///
/// shift() re-anchors the hand: what it adds is part of C_w, so everybody who knows C_w or the hand's pose
/// agrees, and decays as slowly as the workspace moves, out of contact alone.
///
/// Threads: one. Real-time: everything.
class Workspace {
 public:
  explicit Workspace(const WorkspaceOptions& options) : options_(options) {}

  /// Places C_w and cancels a moveTo().
  void setCentre(const Vector3& p_WC) noexcept;
  /// Starts to move C_w to p_WC at up to move_speed. The hand may move relative to C_w meanwhile.
  void moveTo(const Vector3& p_WC) noexcept;
  [[nodiscard]] bool moveInProgress() const noexcept { return move_in_progress_; }

  /// C_w jumps by p_CC_W; velocity() does not count it.
  void shift(const Vector3& p_CC_W) noexcept;
  /// What is left of all shifts.
  [[nodiscard]] const Vector3& shifted() const noexcept { return shifted_; }

  /// One cycle of `dt` [s] with the hand at p_DH. Contact stops the motion at once.
  void step(const Vector3& p_DH, bool in_contact, double dt) noexcept;
  /// One cycle while the person de-clutches: C_w moves against the device, so that the hand, which has the
  /// velocity v_DH there, stays at p_WH. What the person places so is kept: a moveTo() and the rest of shifts
  /// end.
  void stepDeclutched(const Vector3& p_WH, const Vector3& p_DH, const Vector3& v_DH) noexcept;

  [[nodiscard]] const Vector3& centre() const noexcept { return p_WC_; }
  /// Velocity of C_w in the last cycle; the hand's velocity in W is the sum of it and the velocity in D.
  [[nodiscard]] const Vector3& velocity() const noexcept { return v_WC_; }
  /// C_w moved in the last cycle.
  [[nodiscard]] bool moving() const noexcept { return moving_; }
  [[nodiscard]] Pose toWorld(const Pose& X_DH) const noexcept {
    return {p_WC_ + X_DH.translation(), X_DH.rotation()};
  }
  [[nodiscard]] Pose toDevice(const Pose& X_WH) const noexcept {
    return {X_WH.translation() - p_WC_, X_WH.rotation()};
  }

 private:
  WorkspaceOptions options_;
  Vector3 p_WC_ = Vector3::Zero();
  Vector3 v_WC_ = Vector3::Zero();
  Vector3 shifted_ = Vector3::Zero();  // [m]
  Vector3 move_from_ = Vector3::Zero();
  Vector3 move_to_ = Vector3::Zero();
  double move_elapsed_ = 0.0;   // [s]
  double move_duration_ = 0.0;  // [s]
  unsigned free_ticks_ = 0;     // since the last contact, up to settle_ticks
  bool move_in_progress_ = false;
  bool moving_ = false;
};

}  // namespace tenon::haptic
