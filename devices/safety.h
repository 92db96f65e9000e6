#pragma once

#include <array>
#include <cstdint>

#include "devices/device.h"
#include "devices/safety_rules.h"

namespace tenon {

/// The clutch as the safety layers of both arms of one machine see it: what one latches holds for the other.
///
/// Threads: one servo thread. Real-time: yes.
struct ClutchLatch {
  bool open = false;
};

/// What a force source wants of a device for the next period.
struct SafetyRequest {
  DeviceCommand wanted;
  double age = 0.0;        ///< [s] since the source last computed that force from something it heard
  double stiffness = 0.0;  ///< [N/m] the force was made with; 0 when it is no spring
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  bool dead_man = true;               ///< somebody holds on
  bool emergency_stop = false;
};

/// That a rule began to act, or that it has come to rest, for the event log.
struct Intervention {
  std::uint64_t tick = 0;  ///< of this layer, from 1
  SafetyRule rule = SafetyRule::kForcesOff;
  bool began = true;
  double before = 0.0;       ///< [N] wanted, at its beginning
  double after = 0.0;        ///< [N] shown
  std::uint64_t acted = 0;   ///< [ticks] of an intervention that ended
  std::uint32_t untold = 0;  ///< earlier interventions of this rule that nobody was told of
};

/// Stands between any force source and any device: what leaves here may be felt by a person.
///
/// The rules run in a fixed order, and everything that may add force (damping, the wall) stands before the
/// limits. Fading and falling are always allowed at once; growing is not. Clutch and emergency stop are
/// latched until reset(), which is for an operator who has looked; the others end with their cause and start
/// softly again. It reads no clock: a tick is `dt`, so each rule is testable in virtual time.
///
/// Threads: the device's servo thread. Real-time: everything but the constructor.
class Safety {
 public:
  /// `clutch` is shared by the arms of one machine and outlives them; null for a device of its own.
  explicit Safety(const DeviceCaps& caps, ClutchLatch* clutch = nullptr) noexcept;

  /// Between read and write of each cycle: what may be written.
  [[nodiscard]] DeviceCommand step(const SafetyRequest& request, const DeviceState& state,
                                   double dt) noexcept;

  /// The rules that acted in the last step, as bits of SafetyRule.
  [[nodiscard]] std::uint32_t flags() const noexcept { return flags_; }
  [[nodiscard]] bool acts(SafetyRule rule) const noexcept { return (flags_ & bit(rule)) != 0; }
  /// The force is stale or a stop is latched: the caller disarms the device.
  [[nodiscard]] bool wantsDisarm() const noexcept;
  /// By the operator, after the resetFault() of all arms of the machine: an arm still in fault would latch
  /// again.
  void reset() noexcept;

  /// Oldest first; false when there is none. A rule that flickers with rests of less than half a second is
  /// one intervention. Of rules that are part of every day's work one is told in ten seconds, with the number
  /// of those in between.
  [[nodiscard]] bool next(Intervention& intervention) noexcept;
  /// Interventions overwritten before anybody took them.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

  [[nodiscard]] const SafetyLimits& limits() const noexcept { return limits_; }
  /// [J] at the port between device and hand; in debt when negative.
  [[nodiscard]] double energy() const noexcept { return passivity_.energy(); }

 private:
  void raise(SafetyRule rule, bool acts) noexcept;
  void watchPort(const DeviceState& state, double dt) noexcept;
  [[nodiscard]] bool mustBrake(const SafetyRequest& request, const DeviceState& state) noexcept;
  [[nodiscard]] bool mayPush(const SafetyRequest& request, const DeviceState& state) noexcept;
  [[nodiscard]] Wrench fit(const SafetyRequest& request) noexcept;
  [[nodiscard]] Wrench started(const Wrench& wanted, double dt) noexcept;
  [[nodiscard]] Wrench steadied(const Wrench& wanted, const DeviceState& state, double dt) noexcept;
  [[nodiscard]] Wrench bounded(const Wrench& wanted, double dt) noexcept;
  void tell(double wanted_force) noexcept;

  static constexpr std::size_t kRing = 64;

  SafetyLimits limits_;
  ClutchLatch* clutch_;
  std::uint64_t tick_ = 0;
  std::uint32_t flags_ = 0;
  bool stopped_ = false;          ///< emergency stop, latched
  bool clutch_released_ = false;  ///< latched here when nobody shares the clutch
  bool braking_ = false;
  double since_start_ = 0.0;  ///< [s] of pushing
  Wrench grown_;              ///< the last force after the slew limit
  Wrench shown_;              ///< the last force that left here
  Pose X_DH_last_;
  bool seen_ = false;
  MotorHeat heat_;
  PassivityObserver passivity_;

  /// A rule from its first act to its rest.
  struct Episode {
    std::uint64_t last = 0;     ///< [tick] it acted
    std::uint64_t acted = 0;    ///< [ticks]
    std::uint64_t told_at = 0;  ///< [tick] the last beginning that was told; 0: none yet
    std::uint32_t untold = 0;
    bool open = false;
    bool told = false;
  };
  void begin(Episode& episode, SafetyRule rule, double wanted_force) noexcept;
  void push(const Intervention& intervention) noexcept;

  std::array<Episode, kSafetyRules> episodes_{};  ///< by bit
  std::array<Intervention, kRing> ring_{};
  std::uint64_t told_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace tenon
