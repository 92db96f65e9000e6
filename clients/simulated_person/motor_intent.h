#pragma once

#include <algorithm>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

namespace tenon::simulated_person {

/// Intended hand pose in the device's frame D, as an arm gets it: a person aims in the scene, but the arm
/// cannot follow when the scene jumps before the hand (HapticHand re-anchors it). The position goes to the
/// wanted one at kSpeed at most, and reaches that speed as slowly as an arm does: at once, the arm's mass on
/// its spring would overshoot the speed at which a device brakes, and pull a magnetic clutch open.
///
/// Threads: one. Real-time: everything.
class MotorIntent {
 public:
  /// Forgets where it is: the next pose is taken at once.
  void reset() noexcept {
    begun_ = false;
    speed_ = 0.0;
  }
  /// One millisecond: the pose that the arm intends when the person wants X_DI.
  [[nodiscard]] const Pose& towards(const Pose& X_DI) noexcept {
    if (!begun_) p_DI_ = X_DI.translation();
    begun_ = true;
    const Vector3 way = X_DI.translation() - p_DI_;
    const bool is_behind = way.norm() > kSpeed * kTickSeconds;
    speed_ = is_behind ? std::min(kSpeed, speed_ + kAcceleration * kTickSeconds) : way.norm() / kTickSeconds;
    p_DI_ += clampNorm(way, speed_ * kTickSeconds);
    X_DI_ = Pose(p_DI_, X_DI.rotation());
    return X_DI_;
  }
  /// The hand takes the handle at X_DH again, which it has let go: it sets off from there.
  [[nodiscard]] const Pose& rest(const Pose& X_DH) noexcept {
    begun_ = true;
    speed_ = 0.0;
    p_DI_ = X_DH.translation();
    X_DI_ = X_DH;
    return X_DI_;
  }

  static constexpr double kSpeed = 0.8;         ///< [m/s] below the speed at which a device brakes
  static constexpr double kAcceleration = 1.0;  ///< [m/s^2] towards what has jumped

 private:
  Vector3 p_DI_ = Vector3::Zero();
  double speed_ = 0.0;  ///< [m/s]
  Pose X_DI_;
  bool begun_ = false;
};

}  // namespace tenon::simulated_person
