#pragma once

#include "idl/types/spatial.h"

namespace tenon {

/// A body standing in the scene: where elbow and head are when a hand is where it is.
///
/// Stands in for the trackers of arm band and head: the body goes with the workspace (who indexes does not
/// walk, but sees herself carried along), the wrist is at the hand, the elbow hangs as low as upper arm and
/// forearm allow, and the head follows the hand with its eyes, calmly.
///
/// Threads: one. Real-time: everything.
class Posture {
 public:
  /// `side` is +1 for a right arm, -1 for a left one.
  explicit Posture(double side = 1.0) : side_(side) {}

  void step(const Pose& X_WH, const Vector3& p_WC, double dt) noexcept;
  /// Origin at the elbow, x towards the wrist, z as far up as that allows.
  [[nodiscard]] const Pose& forearm() const noexcept { return X_WF_; }
  /// Between the eyes; y where they look, z up.
  [[nodiscard]] const Pose& head() const noexcept { return X_WE_; }

 private:
  double side_;
  Pose X_WF_;
  Pose X_WE_;
  Vector3 gaze_W_ = Vector3::Zero();  // the point looked at; zero before the first step
};

}  // namespace tenon
