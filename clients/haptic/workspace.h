#pragma once

#include "idl/types/spatial.h"

namespace tenon {

/// How a device's workspace moves through a larger scene; numbers are the device's own (DeviceCaps).
struct WorkspaceOptions {
  double radius = 0.2;         ///< r_w [m]
  double gain = 1.5;           ///< lambda_w [1/s]
  double go_to_speed = 0.4;    ///< [m/s] highest, half way of a "go to"
  unsigned settle_ticks = 50;  ///< free of contact this long before the workspace moves again
};

/// Where the device's centre is in the scene: C_w of the paper (§4.3), and its two ways of moving.
///
/// Indexing by eq. 1 moves it after a hand that leaves the sphere of radius r_w; "go to" takes it elsewhere
/// on a smooth path. Both wait while the hand's object is in contact: the wall felt would otherwise move with
/// the workspace. The device's axes are the world's, unscaled.
///
/// Threads: one. Real-time: everything.
class Workspace {
 public:
  explicit Workspace(const WorkspaceOptions& options) : options_(options) {}

  void place(const Vector3& p_WC) noexcept;
  /// Takes C_w to another place; the hand may move meanwhile and keeps its place relative to C_w.
  void goTo(const Vector3& p_WC) noexcept;
  void stay() noexcept { going_ = false; }
  [[nodiscard]] bool going() const noexcept { return going_; }

  /// One cycle of `dt` with the hand at p_DH. Contact stops it at once.
  void step(const Vector3& p_DH, bool in_contact, double dt) noexcept;

  [[nodiscard]] const Vector3& centre() const noexcept { return p_WC_; }
  /// Of C_w, in the last cycle: adds to the hand's own velocity.
  [[nodiscard]] const Vector3& velocity() const noexcept { return v_WC_; }
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
  Vector3 go_from_ = Vector3::Zero();
  Vector3 go_to_ = Vector3::Zero();
  double go_elapsed_ = 0.0;
  double go_duration_ = 0.0;
  unsigned free_ticks_ = 0;
  bool going_ = false;
  bool moving_ = false;
};

}  // namespace tenon
