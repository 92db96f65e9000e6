#pragma once

#include <algorithm>
#include <numbers>

#include "idl/types/spatial.h"

namespace tenon {

/// [s] A pose is extrapolated for so long at most; then the body is taken to stand.
inline constexpr double kLongestExtrapolation = 0.15;

/// Where a body with X_WO and V_WO is `ahead` [s] later: it keeps the velocity of its point Q, at p_OQ_O [m],
/// and its angular velocity (constant twist), for at most kLongestExtrapolation. A function of its arguments
/// alone, by which whoever knows what was heard of a body knows where another program expects it.
[[nodiscard]] inline Pose extrapolated(const Pose& X_WO, const Twist& V_WO, const Vector3& p_OQ_O,
                                       double ahead) {
  const double time = std::clamp(ahead, 0.0, kLongestExtrapolation);
  const Vector3 v_WQ = V_WO.linear + V_WO.angular.cross(X_WO.rotation() * p_OQ_O);
  return displaced(X_WO, {v_WQ * time, clampNorm(V_WO.angular * time, std::numbers::pi)}, p_OQ_O);
}

/// [-] Share of its motion by which a body whose points move at `speed` [m/s] is extrapolated: none of slow
/// motion. What gives way under a hand's push is heard late, and its velocity would be fed back with the gain
/// of the delay.
[[nodiscard]] constexpr double extrapolationWeight(double speed) {
  constexpr double kSlow = 0.01;  // [m/s]
  return std::clamp(speed / kSlow - 1.0, 0.0, 1.0);
}

/// [m] Most that a point is off extrapolated() that is accelerated by up to `acceleration` [m/s^2] meanwhile,
/// for `ahead` [s].
[[nodiscard]] constexpr double extrapolationError(double acceleration, double ahead) {
  return 0.5 * acceleration * ahead * ahead;
}

}  // namespace tenon
