#pragma once

#include "idl/types/spatial.h"

/// Insertion primitives of a simulated hand: push with a force, search in a spiral, comply with the contact.
/// Each depends on its arguments and its own state alone.
///
/// Threads: any; one per SpiralSearch or StallDetector. Real-time: all.
namespace tenon::simulated_person {

/// Unit vectors u and v such that u, v and the unit vector `axis` are orthogonal in pairs.
void orthonormalBasis(const Vector3& axis, Vector3& u, Vector3& v) noexcept;

/// `offset` after `dt` [s] of first-order decay with the time constant `time` [s].
[[nodiscard]] Displacement decayed(const Displacement& offset, double dt, double time) noexcept;

/// Outward normal (in W) of the face at which an object with a bounding box of size_W is touched: the front
/// (-y) of upright objects, the top of all others.
[[nodiscard]] Vector3 touchNormal(const Vector3& size_W) noexcept;

/// Offset (in W) from the centre of an object to the point that is tried when a touch met no resistance;
/// `attempt` counts from 0.
[[nodiscard]] Vector3 probeOffset(unsigned attempt) noexcept;

/// [m] Step along the push in `dt` [s]: proportional control of the force, `target_force` [N] against
/// `measured_force` [N], at no more than `max_speed` [m/s] in either direction.
[[nodiscard]] double pushStep(double target_force, double measured_force, double max_speed,
                              double dt) noexcept;

/// The aim X_WAim, moved by `fraction` [-] of the offset across axis_W of the object's centre p_OQ_O to its
/// actual pose X_WO: lateral compliance.
[[nodiscard]] Pose compliedLaterally(const Pose& X_WO, const Pose& X_WAim, const Vector3& p_OQ_O,
                                     const Vector3& axis_W, double fraction) noexcept;

/// The aim X_WAim, turned about the object's centre p_OQ_O by `fraction` [-] of the rotation to its actual
/// pose X_WO; unchanged when the object is visibly tilted against the target X_WG.
[[nodiscard]] Pose compliedInRotation(const Pose& X_WO, const Pose& X_WAim, const Pose& X_WG,
                                      const Vector3& p_OQ_O, double fraction) noexcept;

/// Rotation vector (in W) added to the hand against a visible tilt of the object, integrated over `dt` [s]
/// from its value turned_W one tick ago. Bounded by what a wrist can turn.
[[nodiscard]] Vector3 tiltCorrection(const Vector3& turned_W, const Pose& X_WO, const Pose& X_WAim,
                                     double dt) noexcept;

/// Spiral search for an opening: an Archimedean spiral in the plane across the push, with the object tilted
/// and twisted periodically.
class SpiralSearch {
 public:
  /// Advances by `dt` [s]; slower when `near`, that is when the object has begun to enter.
  void step(bool near, double dt) noexcept;
  /// [m] Displacement (in W) across axis_W.
  [[nodiscard]] Vector3 offset(const Vector3& axis_W) const noexcept;
  /// Rotation (in W) about axes across axis_W and about axis_W itself.
  [[nodiscard]] Quaternion tilt(const Vector3& axis_W) const noexcept;
  [[nodiscard]] double radius() const noexcept { return radius_; }  ///< [m]

 private:
  double radius_ = 0.0;                // [m]
  Vector3 spiral_ = Vector3::UnitX();  // (cos, sin) of the spiral's angle
  Vector3 tilt_ = Vector3::UnitX();    // (cos, sin) of the phase of tilt and twist
};

/// Detects that a push makes no progress.
class StallDetector {
 public:
  /// Begins a period of 0.4 s at `depth` [m].
  void start(double depth) noexcept;
  /// Call every tick (1 ms) with the perceived `depth` [m]. At the end of each period: true when the depth
  /// grew by less than `progress` [m] in it; false in all other ticks.
  [[nodiscard]] bool stalled(double depth, double progress) noexcept;

 private:
  double time_ = 0.0;   // [s] in this period
  double depth_ = 0.0;  // [m] at its begin
};

}  // namespace tenon::simulated_person
