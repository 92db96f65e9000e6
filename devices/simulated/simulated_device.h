#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "devices/device.h"
#include "devices/simulated/device_clock.h"
#include "devices/simulated/human_arm.h"
#include "idl/types/random.h"

namespace tenon::devices {

/// Mechanics and electronics of one make. The file of each make sets the numbers and states their sources.
struct SimulatedModel {
  DeviceCaps caps;                   ///< its physical_damping is the damping of the mechanics
  double mass = 0.3;                 ///< [kg] apparent mass at the grip, isotropic
  double inertia = 5e-4;             ///< [kgm2] apparent inertia about the grip, isotropic
  double friction = 0.0;             ///< [N] Coulomb friction while sliding
  double rotational_friction = 0.0;  ///< [Nm]
  double position_resolution = 0.0;  ///< [m] of one encoder count; 0: not quantised
  double angle_resolution = 0.0;     ///< [rad] likewise
  unsigned velocity_window = 1;      ///< [ticks] over which velocity is averaged, 1 to kLongestWindow
  unsigned delay = 0;                ///< [ticks] from write to force, at most kLongestDelay
  bool force_sensor = false;
};

/// Magnetic clutch between hand and robot, shared by both arms of a bimanual device. Openings are counted, so
/// that an arm detects one even if the clutch was closed again before its next cycle.
///
/// Threads: one servo thread. Real-time: yes.
struct MagneticClutch {
  bool open = false;
  std::uint32_t openings = 0;
};

/// Simulated device: mass, damping, dry friction, end stops, encoders, delay and force limits, with a
/// simulated arm that holds the handle.
///
/// Each read() advances time by 1 ms with the newest command held, as in a sampled-data loop, so that an
/// unstable force law is unstable here, too. No clock is read but by awaitReading(); random numbers (friction
/// of this device within 10 % of the make's, noise of the force sensor) come from the seed, so a session
/// repeats bit by bit. Gravity is compensated.
///
/// Threads: one servo thread, also for humanArm(). Real-time: read, write, disarm and all of humanArm().
class SimulatedDevice : public HapticDevice {
 public:
  static constexpr unsigned kLongestWindow = 31;
  static constexpr unsigned kLongestDelay = 7;
  /// [ticks] without a write until an armed device turns its forces off: Force Dimension's watchdog ends at
  /// 255 x 125 us.
  static constexpr unsigned kWatchdog = 32;

  enum class Phase : std::uint8_t { kClosed, kOpen, kArmed, kFault };

  explicit SimulatedDevice(SimulatedModel model, std::uint64_t seed = 1,
                           std::shared_ptr<MagneticClutch> clutch = nullptr);

  /// Button of the simulated dead man's switch, see addDeadManSwitch().
  static constexpr std::uint32_t kDeadManButton = 1U << 7U;
  /// The button that de-clutches a desktop device.
  static constexpr std::uint32_t kDeclutchButton = 1U << 6U;

  [[nodiscard]] Result<void> open();
  void close() noexcept;
  /// Gives it a dead man's switch, which the arm presses by HumanArm::setButtons.
  void addDeadManSwitch() noexcept { model_.caps.dead_man = kDeadManButton; }
  /// Gives it a clock of its own, which runs by `clock` and paces the loop.
  void addClock(std::shared_ptr<threads::Clock> clock, std::uint64_t seed) {
    clock_.emplace(std::move(clock), seed);
  }
  void setSerial(std::string serial) { model_.caps.serial = std::move(serial); }

  [[nodiscard]] const DeviceCaps& caps() const override { return model_.caps; }
  [[nodiscard]] Result<void> arm() override;
  void disarm() noexcept override;
  [[nodiscard]] Result<void> resetFault() override;
  [[nodiscard]] bool paces() const noexcept override { return clock_.has_value(); }
  [[nodiscard]] bool awaitReading(std::chrono::nanoseconds longest) noexcept override {
    return clock_ && phase_ != Phase::kClosed && clock_->await(longest);
  }
  void read(DeviceState& state) noexcept override;
  void write(const DeviceCommand& command) noexcept override;

  [[nodiscard]] HumanArm& humanArm() noexcept { return arm_; }
  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Loss of communication: readings stop until the device is opened again.
  void unplug() noexcept;
  /// Wrench of the motors on the handle, about the hand's origin, in D.
  [[nodiscard]] const Wrench& motorWrench() const noexcept { return F_Ho_D_motor_; }

 private:
  void fault(DeviceFault why) noexcept;
  void checkWatchdog() noexcept;
  void checkClutch() noexcept;
  void advance() noexcept;
  /// Integrates hand and handle over `dt` [s]; returns the wrench of the handle on the hand.
  [[nodiscard]] Wrench stepHandle(double dt) noexcept;
  [[nodiscard]] Wrench endStops() const noexcept;
  /// The command as the motors can realise it: quantised, saturated, without axes that are not actuated.
  [[nodiscard]] Wrench saturateCommand(const Wrench& F_Ho_D) const noexcept;
  void sense() noexcept;
  [[nodiscard]] Pose quantizePose(const Pose& X_DH) const noexcept;
  /// [-] uniform in [-1, 1).
  [[nodiscard]] double noise() noexcept { return random_.uniform(-1.0, 1.0); }
  [[nodiscard]] bool rotates() const noexcept;

  SimulatedModel model_;
  HumanArm arm_;
  std::shared_ptr<MagneticClutch> clutch_;
  std::uint32_t clutch_openings_seen_ = 0;
  Random random_;
  std::optional<DeviceClock> clock_;
  Phase phase_ = Phase::kClosed;
  DeviceState state_;
  bool braked_ = false;
  unsigned ticks_since_write_ = 0;

  Pose X_DH_;  ///< true pose of the handle
  Twist V_DH_;
  Wrench F_Ho_D_newest_;  ///< newest command after saturateCommand()
  Wrench F_Ho_D_motor_;
  std::array<Wrench, kLongestDelay + 1> commands_{};  ///< delay line, by tick modulo its size
  std::array<Pose, kLongestWindow + 1> readings_{};   ///< past poses, likewise
};

/// Serial numbers of the simulated devices of each make that there are: units of one make differ in friction.
[[nodiscard]] std::vector<std::string> simulatedSerials();
/// Of the unit `serial`; empty: the first one. Precondition: there is one.
[[nodiscard]] std::uint64_t unitSeed(std::uint64_t seed, const std::string& serial);

/// The simulated arm that holds `device`; null if there is none.
[[nodiscard]] inline HumanArm* simulatedHumanArm(HapticDevice& device) noexcept {
  auto* const simulated = dynamic_cast<SimulatedDevice*>(&device.inner());
  return simulated ? &simulated->humanArm() : nullptr;
}

}  // namespace tenon::devices
