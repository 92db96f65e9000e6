#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "idl/types/spatial.h"

/// Resolution of device samples in messages and journals: each number is a whole multiple of a step, in 32
/// bits. The steps are far below what encoders resolve (10 um, 50 urad), so that nothing is felt of them, and
/// powers of two, so that rounding is exact and equal on every machine.
namespace tenon {

inline constexpr double kPositionStep = 0x1p-24;  ///< [m] 60 nm; 32 bits reach 128 m
inline constexpr double kRotationStep = 0x1p-26;  ///< [-] of the components of a unit quaternion: 30 nrad
inline constexpr double kVelocityStep = 0x1p-20;  ///< [m/s], [rad/s] 1 um/s; 32 bits reach 2 km/s

/// The nearest number of steps of `value` [unit of step]; `step` [any unit]. Halves away from zero. What 32
/// bits do not reach, and NaN, is the smallest number, which no server takes for a plausible value.
[[nodiscard]] inline std::int32_t toSteps(double value, double step) noexcept {
  constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::min();
  const double steps = std::round(value / step);
  return std::abs(steps) <= std::numeric_limits<std::int32_t>::max() ? static_cast<std::int32_t>(steps)
                                                                     : kNone;
}
/// [unit of step] `step` [any unit].
[[nodiscard]] inline double fromSteps(std::int32_t steps, double step) noexcept { return steps * step; }

/// What arrives of `v` [unit of step] over the wire; `step` [any unit].
template <class Vector>
[[nodiscard]] Vector rounded(Vector v, double step) noexcept {
  for (int i = 0; i < v.size(); ++i) v[i] = fromSteps(toSteps(v[i], step), step);
  return v;
}
/// Its quaternion has unit length up to rounding.
[[nodiscard]] inline Pose rounded(const Pose& X) noexcept {
  Pose rounded_X(rounded(X.translation(), kPositionStep), Quaternion::Identity());
  rounded_X.rotation().coeffs() = rounded(Eigen::Vector4d(X.rotation().coeffs()), kRotationStep);
  return rounded_X;
}
[[nodiscard]] inline Twist rounded(const Twist& V) noexcept {
  return {rounded(V.linear, kVelocityStep), rounded(V.angular, kVelocityStep)};
}

}  // namespace tenon
