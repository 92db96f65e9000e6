#pragma once

#include <cstdint>

#include "devices/device.h"
#include "idl/types/spatial.h"

namespace tenon::devices {

/// Rules of the safety layer, one bit each.
enum class SafetyRule : std::uint32_t {
  kNonFinite =
      1U << 0U,  ///< a requested wrench or stiffness is NaN or infinite: zero force, then a soft start
  kAgeFading = 1U << 1U,         ///< the force fades because its request is old
  kStale = 1U << 2U,             ///< the request is too old: no force, then a soft start
  kStiffnessLimited = 1U << 3U,  ///< the force is scaled to the stiffness the device renders passively
  kSoftStart = 1U << 4U,         ///< ramp after arming, a stop, a gap or a jump
  kSlewLimited = 1U << 5U,       ///< force or torque grows at its largest rate
  kPassivity = 1U << 6U,         ///< damping is injected: the port has delivered more energy than it took
  kWorkspaceWall = 1U << 7U,     ///< a spring at the end of the workspace pushes back
  kForceLimited = 1U << 8U,      ///< force or torque above its command limit
  kThermal = 1U << 9U,           ///< motors warm: limit between continuous and peak force
  kMotorSaturated = 1U << 10U,   ///< above the range of a motor command
  kOverspeed = 1U << 11U,        ///< hand speed above the limit: brake
  kClutchWarning = 1U << 12U,    ///< measured force near the clutch's opening force
  kClutchOpen = 1U << 13U,       ///< both arms stopped; latched
  kDeadMan = 1U << 14U,          ///< dead-man switch released: no force
  kEmergencyStop = 1U << 15U,    ///< latched
  kForcesOff = 1U << 16U,        ///< the device has no forces on or is in fault
  kNotArmed = 1U << 17U,         ///< the person has not armed the device: brake, no force
};

inline constexpr int kSafetyRules = 18;

[[nodiscard]] constexpr std::uint32_t bit(SafetyRule rule) { return static_cast<std::uint32_t>(rule); }
/// Text for messages and logs.
[[nodiscard]] const char* toString(SafetyRule rule) noexcept;

/// Limits that the safety layer applies to one device. Values of the make come from its DeviceCaps; the
/// others are constants of the safety layer [assumed].
struct SafetyLimits {
  std::uint32_t dof_mask = 0;
  double continuous_force = 0.0;             ///< [N]
  double peak_force = 0.0;                   ///< [N] not above the command limit
  double torque = 0.0;                       ///< [Nm]
  double thermal_time = 0.0;                 ///< [s] time constant; 0: no thermal limit
  double force_slew = 0.0;                   ///< [N/s]
  double torque_slew = 0.0;                  ///< [Nm/s]
  double stiffness = 0.0;                    ///< [N/m] passive at the device's rate, delay and damping
  double rotational_stiffness = 0.0;         ///< [Nm/rad] likewise
  double injected_damping = 0.0;             ///< [Ns/m]
  double injected_rotational_damping = 0.0;  ///< [Nms/rad]
  double max_speed = 0.0;                    ///< [m/s]
  double wall_radius = 0.0;                  ///< [m] about the device's centre
  double wall_stiffness = 0.0;               ///< [N/m]
  double clutch_force = 0.0;                 ///< [N] 0: no clutch
  double clutch_warning = 0.0;               ///< [N]
  double force_quantum = 0.0;                ///< [N] of one motor count; 0: not quantised
  double energy_capacity = 0.0;  ///< [J] bound of the energy balance: the most that may be returned later
  double active_power = 0.0;     ///< [W] that the device may deliver without having taken it before

  double fade_from = 0.020;        ///< [s] age of a request at which its force begins to fade: it is a gap
  double stale_at = 0.100;         ///< [s] age at which it is 0
  double soft_start = 1.0;         ///< [s] duration of the ramp
  double start_force = 3.0;        ///< [N] largest force in it, or that before it
  double start_force_slew = 20.0;  ///< [N/s] largest growth of the force in it
  double start_torque = 0.0;       ///< [Nm] as start_force, for torques
  double start_torque_slew = 0.0;  ///< [Nm/s] as start_force_slew
};

[[nodiscard]] SafetyLimits safetyLimits(const DeviceCaps& caps) noexcept;

// ---- the rules: pure functions of one tick. Threads: any. Real-time: all.

[[nodiscard]] bool isFinite(const Wrench& wrench) noexcept;
/// Factor [-] for the force of a request of `age` [s]: 1 up to `fade_from`, linearly to 0 at `stale_at`; 0
/// for NaN.
[[nodiscard]] double ageFactor(double age, const SafetyLimits& limits) noexcept;
/// Factor [-] that turns the force of a spring of stiffness `K` [N/m, Nm/rad] into that of `limit` [N/m,
/// Nm/rad] if K is above it; 0 for NaN.
[[nodiscard]] double stiffnessFactor(double K, double limit) noexcept;
/// Factor [-] of the ramp, `since_start` [s] after the forces came on.
[[nodiscard]] double softStartFactor(double since_start, const SafetyLimits& limits) noexcept;
/// Output of the next cycle, from `output` towards `target`: a decrease or a change of direction acts at
/// once, the component along `target` grows by at most `step` [N or Nm].
[[nodiscard]] Vector3 slewLimited(const Vector3& output, const Vector3& target, double step) noexcept;
/// [N] of the spring outside `wall_radius`, at `distance` [m] from the centre; zero inside.
[[nodiscard]] double wallForce(double distance, const SafetyLimits& limits) noexcept;
/// [N] inward force of that spring.
[[nodiscard]] Vector3 wallForce(const Vector3& p_DH, const SafetyLimits& limits) noexcept;
/// [N/m] of that spring which a scene's spring of `stiffness` [N/m] with force `scene` [N] leaves it at p_DH:
/// all where the scene does not push outwards, else so much that both are in no direction stiffer than the
/// passive stiffness.
[[nodiscard]] double wallStiffnessBeside(const Vector3& scene, double stiffness, const Vector3& p_DH,
                                         const SafetyLimits& limits) noexcept;
/// Per axis rounded towards zero to whole motor counts of `quantum` [N] and saturated at +-kMaxMotorCounts.
[[nodiscard]] Vector3 quantizeForce(const Vector3& force, double quantum) noexcept;

/// Motor temperature as a fraction of the steady temperature at continuous force: first-order lag of
/// (F / F_continuous)^2.
///
/// Threads: one. Real-time: everything.
class MotorThermalModel {
 public:
  /// The motors produce `force` [N] for `dt` [s].
  void update(double force, double dt, const SafetyLimits& limits) noexcept;
  /// [N] peak force while cool, falling linearly to continuous force between 0.8 and 1: without steps.
  [[nodiscard]] double forceLimit(const SafetyLimits& limits) const noexcept;

 private:
  double heat_ = 0.0;  ///< [-] 1: steady temperature at continuous force
};

/// Time-domain passivity observer and controller at the port between device and hand (Hannaford and Ryu
/// 2002).
///
/// Three departures from the paper. Because other people's forces make the shared scene active, the stored
/// energy is bounded, so that energy dissipated by long friction cannot be returned in a burst later; and a
/// small power may be delivered at any time. And the damping grows with the deficit, instead of dissipating
/// it within one step: that chatters with the noise of a velocity, which a hand that is led feels as a buzz.
///
/// Threads: one. Real-time: everything.
class PassivityObserver {
 public:
  /// The hand moved by `motion` within `dt` [s] while the device applied `output`.
  void observe(const Wrench& output, const Displacement& motion, double dt,
               const SafetyLimits& limits) noexcept;
  /// Damping wrench, in D, in proportion to a negative balance: the most that may be injected from a deficit
  /// of the peak force along 1 mm on. It takes no more than the deficit within `dt` [s].
  [[nodiscard]] Wrench damping(const Twist& V_DH, double dt, const SafetyLimits& limits) const noexcept;
  /// [J] energy balance: taken from the hand minus delivered to it.
  [[nodiscard]] double energy() const noexcept { return energy_; }
  /// A deficit is not to be paid back by the next force.
  void forgive() noexcept { energy_ = energy_ < 0.0 ? 0.0 : energy_; }
  void reset() noexcept { energy_ = 0.0; }

 private:
  double energy_ = 0.0;  ///< [J]
};

}  // namespace tenon::devices
