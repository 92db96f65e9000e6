#pragma once

#include "idl/types/spatial.h"

namespace tenon::simulated_person {

/// Posture model of a standing simulated person: forearm and head pose from the pose of the hand.
///
/// Replaces the trackers of the vibrotactile bracelet and of the head. The body is fixed relative to the
/// workspace centre, also while indexing moves that; the wrist is at the hand, the elbow hangs as low as
/// upper arm and forearm allow, and the gaze follows the hand through a low-pass filter.
///
/// Threads: one. Real-time: everything.
class Posture {
 public:
  /// `side` [-] is +1 for a right arm, -1 for a left one.
  explicit Posture(double side = 1.0) : side_(side) {}

  /// Advances by `dt` [s]; p_WC is the centre of the workspace.
  void step(const Pose& X_WH, const Vector3& p_WC, double dt) noexcept;
  /// Origin at the elbow, x towards the wrist, z as far up as that allows.
  [[nodiscard]] const Pose& forearm() const noexcept { return X_WF_; }
  /// Origin between the eyes; y along the gaze, z up.
  [[nodiscard]] const Pose& head() const noexcept { return X_WE_; }

 private:
  double side_;  // [-]
  Pose X_WF_;
  Pose X_WE_;
  Vector3 gaze_W_ = Vector3::Zero();  // point of fixation; zero before the first step
};

}  // namespace tenon::simulated_person
