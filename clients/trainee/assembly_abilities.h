#pragma once

#include "idl/types/spatial.h"

/// What a hand does without thinking about it: small answers to what is seen and felt, each from its
/// arguments alone.
///
/// Threads: any; one a wiggle or a watch. Real-time: all.
namespace tenon {

/// Two unit vectors that stand upright on `axis` and on each other.
void besides(const Vector3& axis, Vector3& u, Vector3& v) noexcept;

/// Shortened to `most`, never turned.
[[nodiscard]] Vector3 noLongerThan(const Vector3& v, double most) noexcept;

/// What is left after dt of what fades within `time`.
[[nodiscard]] Displacement faded(const Displacement& carried, double dt, double time) noexcept;

/// The side from which a thing as large as `size_W` is touched: lying ones from above, upright ones from the
/// front.
[[nodiscard]] Vector3 sideToTouch(const Vector3& size_W) noexcept;

/// Where to feel next, from the middle of what is open there; `attempt` counts from 0.
[[nodiscard]] Vector3 probeAround(unsigned attempt) noexcept;

/// [m] along the push in dt: a hand gives way to more than the wanted force and follows less.
[[nodiscard]] double pushStep(double wanted_force, double felt, double highest_speed, double dt) noexcept;

/// The aim after a share of the way sideways to where the object lies.
[[nodiscard]] Pose yieldedTo(const Pose& X_WO, const Pose& X_WAim, const Vector3& axis_W,
                             double share) noexcept;

/// The aim after a share of the turn to how the object lies; not when that is plainly tilted against the
/// target G.
[[nodiscard]] Pose compliedWith(const Pose& X_WO, const Pose& X_WAim, const Pose& X_WG,
                                double share) noexcept;

/// The turn that is added to the hand, when it has been turned on for dt against a tilt that strikes the eye.
[[nodiscard]] Vector3 uprightAgain(const Vector3& turned_W, const Pose& X_WO, const Pose& X_WAim,
                                   double dt) noexcept;

/// A growing spiral on a face with a rocking and twisting of what is in the hand: how a way in is found.
class Wiggle {
 public:
  void step(bool near, double dt) noexcept;
  [[nodiscard]] Vector3 way(const Vector3& axis_W) const noexcept;
  [[nodiscard]] Quaternion tilt(const Vector3& axis_W) const noexcept;
  [[nodiscard]] double radius() const noexcept { return radius_; }  ///< [m]

 private:
  double radius_ = 0.0;
  Vector3 spiral_ = Vector3::UnitX();  // (cos, sin) of its angle
  Vector3 tilt_ = Vector3::UnitX();    // likewise
};

/// Looks now and then whether what is pushed has gone on.
class StallWatch {
 public:
  void start(double depth) noexcept;
  /// Has it gone less than `way` since the last look? Asked every tick; `depth` is where it is seen.
  [[nodiscard]] bool stalled(double depth, double way) noexcept;

 private:
  double time_ = 0.0;
  double depth_ = 0.0;
};

}  // namespace tenon
