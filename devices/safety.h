#pragma once

#include <array>
#include <cstdint>

#include "devices/device.h"
#include "devices/safety_rules.h"

namespace tenon::devices {

/// Latch of an open clutch, shared by the safety layers of both arms of a bimanual device: either arm stops
/// both.
///
/// Threads: one servo thread. Real-time: yes.
struct ClutchLatch {
  bool open = false;
};

/// Input of the safety layer for one period.
struct SafetyRequest {
  DeviceCommand requested;
  double age = 0.0;  ///< [s] of the data that the command rests on, beyond what their link explains
  /// What the force rests on was interrupted or has jumped: the last force falls within 20 ms, the requested
  /// one does not count, and the next one starts softly from zero.
  bool restart = false;
  double stiffness = 0.0;  ///< [N/m] of the spring that made the force; 0: the force is not a spring's
  double rotational_stiffness = 0.0;  ///< [Nm/rad] likewise
  bool dead_man_held = true;
  bool armed = true;            ///< by the person at the device: otherwise the brake acts, and it is disarmed
  bool emergency_stop = false;  ///< engages the latched stop
};

/// Begin or end of a rule's intervention, for the event log.
struct Intervention {
  std::uint64_t tick = 0;  ///< step of this layer, from 1
  SafetyRule rule = SafetyRule::kForcesOff;
  bool began = true;
  double requested_force = 0.0;    ///< [N] norm at the begin; 0 at an end
  double output_force = 0.0;       ///< [N] likewise
  std::uint64_t active_ticks = 0;  ///< [ticks] in which the rule acted; set at an end
  std::uint32_t unreported = 0;    ///< interventions of this rule since the last reported one
};

/// Safety layer between any force source and a device: every force displayed on a person passes through it.
///
/// The rules run in a fixed order; those that may add force (damping, workspace wall) run before the limits.
/// A force may fall at once and grow only at the slew rate. Clutch and emergency stop are latched until
/// reset(), which an operator triggers after an inspection; the other rules end with their cause, and those
/// that removed the force are followed by a soft start: a ramp of one second, in which the force is not above
/// 3 N or what it was before, nor a torque above SafetyLimits::start_torque or what it was. In the ramp, and
/// then until it is the requested one, a force grows by 20 N/s at most, a torque by start_torque_slew; each
/// settles on its own, so that the one never keeps what the other was before an earlier gap.
/// Time is the sum of `dt`, which the caller measures; no clock is read. However long a step took, forces
/// grow in it as in 2 ms at most.
///
/// Scene and workspace wall are springs of one hand: with one contact they are together no stiffer than what
/// the device renders passively. The wall adds the difference between the wall force and the scene force's
/// component towards the centre. Where the scene pushes outwards, the wall follows the hand with the
/// stiffness that the scene's spring leaves, and the rest of its force comes and goes by 20 N/s; within the
/// wall's radius it fades at that rate.
///
/// Threads: the device's servo thread. Real-time: everything but the constructor.
class Safety {
 public:
  /// `clutch` is shared by the arms of a bimanual device and outlives them; null for a single device.
  explicit Safety(const DeviceCaps& caps, ClutchLatch* clutch = nullptr) noexcept;

  /// Command that may be written to the device; called between its read and its write, every `dt` [s].
  [[nodiscard]] DeviceCommand step(const SafetyRequest& request, const DeviceState& state,
                                   double dt) noexcept;

  /// Rules that acted in the last step, as bits of SafetyRule.
  [[nodiscard]] std::uint32_t flags() const noexcept { return flags_; }
  [[nodiscard]] bool acts(SafetyRule rule) const noexcept { return (flags_ & bit(rule)) != 0; }
  /// A stop is latched, or the device is not armed: the caller writes the command, which brakes, and then
  /// disarms the device.
  [[nodiscard]] bool wantsDisarm() const noexcept;
  /// Forces were permitted in the last step.
  [[nodiscard]] bool forcesOn() const noexcept { return forces_on_; }
  /// Releases the latches. Called for the operator after resetFault() of all arms, because an arm still in
  /// fault latches again.
  void reset() noexcept;

  /// Takes the oldest intervention; false when there is none. Activity with pauses of up to 0.5 s is one
  /// intervention. Rules that act in normal operation are reported at most once in 10 s; `unreported` counts
  /// the others.
  [[nodiscard]] bool takeIntervention(Intervention& intervention) noexcept;
  /// Interventions overwritten before they were taken.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

  [[nodiscard]] const SafetyLimits& limits() const noexcept { return limits_; }
  /// Of the motors, which outlasts this layer: the next one of the device begins with it.
  [[nodiscard]] const MotorThermalModel& heat() const noexcept { return heat_; }
  void setHeat(const MotorThermalModel& heat) noexcept { heat_ = heat; }
  /// [J] energy balance of the port: taken from the hand minus delivered to it.
  [[nodiscard]] double energy() const noexcept { return passivity_.energy(); }

 private:
  void setFlag(SafetyRule rule, bool acts) noexcept;
  // ---- stages of step(), in this order
  /// Energy balance over `dt` [s].
  void observePort(const DeviceState& state, double dt) noexcept;
  /// Emergency stop, arming, clutch and speed; true: brake.
  [[nodiscard]] bool evaluateStops(const SafetyRequest& request, const DeviceState& state) noexcept;
  /// Dead-man switch and state of the device.
  [[nodiscard]] bool forcesPermitted(const SafetyRequest& request, const DeviceState& state) noexcept;
  /// Axes the device lacks, age and stiffness; nothing of a request that is not finite.
  [[nodiscard]] Wrench prepareRequest(const SafetyRequest& request) noexcept;
  /// Soft start; what was displayed falls to zero meanwhile, within 20 ms.
  void restart() noexcept;
  /// Soft start, where no force is displayed.
  void startFromZero() noexcept;
  /// `dt` [s].
  [[nodiscard]] Wrench injectDamping(const DeviceState& state, double dt) noexcept;
  /// [N] what scene and wall together may be in a soft start: 3 N, or what was displayed before.
  [[nodiscard]] double startLimit() const noexcept;
  [[nodiscard]] bool starting() const noexcept { return force_starting_ || torque_starting_; }
  /// The second of a soft start in which force and torque are limited.
  [[nodiscard]] bool inRamp() const noexcept { return since_start_ < limits_.soft_start; }
  /// What was displayed, so not what hot motors took away, of a force or torque that is not late and does not
  /// start.
  void keepSettled() noexcept;
  /// `wrench`, limited to what the scene may display in that second beside the wall.
  [[nodiscard]] Wrench clampedInRamp(const Wrench& wrench) const noexcept;
  /// `wall_growth` [N] in this step, which together with the scene's is limited; `dt` [s].
  [[nodiscard]] Wrench applySoftStartAndSlew(const Wrench& wrench, const Wrench& damping, double wall_growth,
                                             double dt) noexcept;
  /// Advances wall_ by `dt` [s], beside a spring of `stiffness` [N/m] that asks for `scene` [N]; its growth
  /// [N].
  [[nodiscard]] double rampWall(const Vector3& scene, double stiffness, const DeviceState& state,
                                double dt) noexcept;
  /// [N] force of the wall's spring, ramped after arming and limited in a soft start.
  [[nodiscard]] Vector3 wallTarget(const Vector3& p_DH) const noexcept;
  /// [N] what of `wall` may act beside a scene that leaves it `stiffness_left` [N/m]; `growth` [s].
  [[nodiscard]] Vector3 limitedBesideScene(const Vector3& wall, double stiffness_left, const Vector3& p_DH,
                                           double growth) noexcept;
  /// [N] the scene's, as it was displayed last: with injected damping while it starts, else without.
  [[nodiscard]] Vector3 sceneForce() const noexcept {
    return slewed_.force + leaving_.force * leaving_share_;
  }
  /// [N] the difference between the wall force and the scene force's component towards the centre.
  [[nodiscard]] Vector3 wallBesideScene() const noexcept;
  void fadeTactors(const SafetyRequest& request, DeviceCommand& command) const noexcept;
  /// Command, thermal and motor limits; `dt` [s].
  [[nodiscard]] Wrench limitOutput(const Wrench& wrench, double dt) noexcept;
  /// `requested_force` [N].
  void updateEpisodes(double requested_force) noexcept;

  static constexpr std::size_t kRing = 64;

  SafetyLimits limits_;
  ClutchLatch* clutch_;
  std::uint64_t tick_ = 0;
  std::uint32_t flags_ = 0;
  bool stopped_ = false;         ///< emergency stop, latched
  bool clutch_tripped_ = false;  ///< the latch when no other arm shares the clutch
  bool braking_ = false;
  bool forces_on_ = false;
  bool late_ = false;               ///< the last request had begun to fade
  double fade_ = 1.0;               ///< [-] of its force that the age of the last request left
  bool force_starting_ = true;      ///< soft start, until the force is the requested one
  bool torque_starting_ = true;     ///< likewise
  double since_start_ = 0.0;        ///< [s] since the forces came on
  Wrench slewed_;                   ///< last output of the slew limit
  double settled_force_ = 0.0;      ///< [N] last one before it was late or started
  double settled_torque_ = 0.0;     ///< [Nm] likewise
  Wrench injected_;                 ///< damping in the last output, of what did not start
  Wrench leaving_;                  ///< that was displayed when the force restarted
  double leaving_share_ = 0.0;      ///< [-] of it that is left
  Vector3 wall_ = Vector3::Zero();  ///< [N] last output of the workspace wall
  double wall_since_ = 0.0;         ///< [s] since forces are permitted
  double wall_distance_ = 0.0;      ///< [m] of the hand from the centre, in the last step
  bool wall_lags_ = false;          ///< it is not yet the force of its spring again
  bool wall_was_slow_ = false;      ///< it grew as a force that starts, in the last step
  Wrench output_;                   ///< last commanded wrench
  Pose X_DH_last_;
  bool has_last_pose_ = false;
  MotorThermalModel heat_;
  PassivityObserver passivity_;

  /// Activity of a rule, from its begin until it has paused for 0.5 s.
  struct Episode {
    std::uint64_t last = 0;          ///< [tick] in which it acted last
    std::uint64_t active_ticks = 0;  ///< [ticks]
    std::uint64_t reported_at = 0;   ///< [tick] of the last reported begin; 0: none yet
    std::uint32_t unreported = 0;    ///< begins since then
    bool open = false;
    bool reported = false;  ///< this one's begin was reported
  };
  /// `requested_force` [N].
  void openEpisode(Episode& episode, SafetyRule rule, double requested_force) noexcept;
  /// Overwrites the oldest when the ring is full.
  void queue(const Intervention& intervention) noexcept;

  std::array<Episode, kSafetyRules> episodes_{};  ///< by bit
  std::array<Intervention, kRing> ring_{};
  std::uint64_t queued_ = 0;  ///< interventions written to the ring
  std::uint64_t taken_ = 0;   ///< interventions read from it or overwritten
  std::uint64_t lost_ = 0;
};

}  // namespace tenon::devices
