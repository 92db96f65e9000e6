#pragma once

#include <cstdint>

#include "devices/device.h"
#include "idl/types/spatial.h"

namespace tenon {

/// A bit for each rule of the safety layer.
enum class SafetyRule : std::uint32_t {
  kNotFinite = 1U << 0U,         ///< a wanted force is no number: none is shown
  kAged = 1U << 1U,              ///< the wanted force is old and fades
  kStale = 1U << 2U,             ///< too old: the device is to be disarmed
  kStiffnessLowered = 1U << 3U,  ///< stiffer than the device can show passively
  kSoftStart = 1U << 4U,         ///< just armed, or just released by another rule
  kSlewed = 1U << 5U,            ///< growth of the force limited
  kPassivity = 1U << 6U,         ///< damping added: the port gave more energy than it took
  kWorkspaceWall = 1U << 7U,     ///< the end of the workspace pushes back
  kForceLimited = 1U << 8U,      ///< over the command limit of force or torque
  kThermal = 1U << 9U,           ///< motors warm: less than peak force
  kWordClamped = 1U << 10U,      ///< more than a motor word can say
  kOverspeed = 1U << 11U,        ///< too fast: brake
  kClutchWarning = 1U << 12U,    ///< measured force near what opens the clutch
  kClutchOpen = 1U << 13U,       ///< both arms stopped; latched
  kDeadMan = 1U << 14U,          ///< nobody holds on: no force
  kEmergencyStop = 1U << 15U,    ///< latched
  kForcesOff = 1U << 16U,        ///< the device is not armed or in fault
};

inline constexpr int kSafetyRules = 17;

[[nodiscard]] constexpr std::uint32_t bit(SafetyRule rule) { return static_cast<std::uint32_t>(rule); }
/// For people and logs.
[[nodiscard]] const char* toString(SafetyRule rule) noexcept;

/// What the rules allow at one device. The numbers that belong to the make come from its DeviceCaps; the
/// others are the house's own and [assumed].
struct SafetyLimits {
  std::uint32_t dof_mask = 0;
  double continuous_force = 0.0, peak_force = 0.0, torque = 0.0;  ///< peak: never above the command limit
  double thermal_time = 0.0;
  double force_slew = 0.0, torque_slew = 0.0;
  double stiffness = 0.0, rotational_stiffness = 0.0;  ///< passive at the device's rate, delay and damping
  double injected_damping = 0.0, injected_rotational_damping = 0.0;
  double max_speed = 0.0;
  double wall_radius = 0.0, wall_stiffness = 0.0;
  double clutch_force = 0.0, clutch_warning = 0.0;
  double force_quantum = 0.0;
  double energy_capacity = 0.0;  ///< [J] at most remembered as taken from the hand and free to give back
  double active_power = 0.0;     ///< [W] a scene in which others push may give to the hand on top

  double fade_from = 0.010, stale_at = 0.030;  ///< [s]; a vendor's watchdog ends at 31.9 ms [published]
  double soft_start = 0.5;                     ///< [s]
};

[[nodiscard]] SafetyLimits safetyLimits(const DeviceCaps& caps) noexcept;

// ---- the rules: pure functions of one tick. All are real-time and may be called from any thread.

[[nodiscard]] bool isFinite(const Wrench& wrench) noexcept;
/// Of the wanted force: 1 while fresh, 0 from `stale_at` on.
[[nodiscard]] double ageFactor(double age, const SafetyLimits& limits) noexcept;
/// Of a force made with stiffness K where only `limit` is passive: the same as making it with `limit`.
[[nodiscard]] double stiffnessFactor(double K, double limit) noexcept;
[[nodiscard]] double softStartFactor(double since_start, const SafetyLimits& limits) noexcept;
/// From `shown` towards `wanted`: what is to fall falls at once, what is to grow grows by at most `step`.
[[nodiscard]] Vector3 slewed(const Vector3& shown, const Vector3& wanted, double step) noexcept;
/// [N] of the wall at the end of the workspace, inwards.
[[nodiscard]] Vector3 wallForce(const Vector3& p_DH, const SafetyLimits& limits) noexcept;
/// Shortened to `limit`, never turned.
[[nodiscard]] Vector3 limited(const Vector3& v, double limit) noexcept;
/// Rounded towards zero to whole motor words of +-4096.
[[nodiscard]] Vector3 inWords(const Vector3& force, double quantum) noexcept;

/// The warmth of the motors as a share of what they bear for ever: a first-order lag of (F / F_continuous)^2.
/// Real-time: everything.
class MotorHeat {
 public:
  void warm(double force, double dt, const SafetyLimits& limits) noexcept;
  /// Peak while cool, sinking to continuous as the heat nears 1: a limit that never jumps.
  [[nodiscard]] double forceLimit(const SafetyLimits& limits) const noexcept;

 private:
  double heat_ = 0.0;
};

/// Counts the energy that crosses between device and hand, and damps when more came out than went in
/// (time-domain passivity, Hannaford and Ryu 2002).
///
/// Two departures from the book, because a shared scene is active: others push. What is remembered as taken
/// is bounded, so that an hour of friction does not pay for a burst; and a small power may flow out for ever.
/// Real-time: everything.
class PassivityObserver {
 public:
  /// The hand moved by `motion` while `shown` pushed it.
  void observe(const Wrench& shown, const Displacement& motion, double dt,
               const SafetyLimits& limits) noexcept;
  /// The damping wrench that pays the debt back within a tick, or as much of it as may be injected.
  [[nodiscard]] Wrench damping(const Twist& V_DH, double dt, const SafetyLimits& limits) const noexcept;
  /// [J] taken from the hand less given to it; in debt when negative.
  [[nodiscard]] double energy() const noexcept { return energy_; }
  void forget() noexcept { energy_ = 0.0; }

 private:
  double energy_ = 0.0;
};

}  // namespace tenon
