#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "devices/device.h"
#include "devices/simulated/human_arm.h"

namespace tenon {

/// The mechanics and electronics of one make; the devices' own files fill it with numbers and their sources.
struct SimulatedModel {
  DeviceCaps caps;                   ///< physical_damping is also what the mechanics have
  double mass = 0.3;                 ///< [kg] apparent at the grip, the same in every direction
  double inertia = 5e-4;             ///< [kgm2] apparent about the grip
  double friction = 0.0;             ///< [N] Coulomb, while sliding
  double rotational_friction = 0.0;  ///< [Nm]
  double rotation_range = 3.0;       ///< [rad] from the middle to the end stop, about any axis
  double position_resolution = 0.0;  ///< [m] of one encoder count
  double angle_resolution = 0.0;     ///< [rad]
  unsigned velocity_window = 1;      ///< [ticks] the velocity is a mean of; at most kLongestWindow
  unsigned delay = 0;                ///< [ticks] from write to force; at most kLongestDelay
  bool force_sensor = false;
};

/// The magnetic coupling between a hand and a strong arm; arms of one machine share it.
/// Each opening is counted, so that an arm that looks late still notices it.
///
/// Threads: one servo thread. Real-time: yes.
struct MagneticClutch {
  bool open = false;
  std::uint32_t openings = 0;
};

/// A device that exists only here: mass, damping, dry friction, end stops, encoders, delay, force limits, and
/// a person's arm that holds its handle.
///
/// Time passes in read(), one period of 1 ms each time, with the newest command held as a true sampled-data
/// loop would: what is unstable on the desk is unstable here. No clock is read and no number is random but
/// for the seed's (friction as this one specimen has it, noise of the force sensor), so a session repeats bit
/// by bit. Gravity is taken as compensated.
///
/// Threads: one servo thread, the hand's intent included. Real-time: read, write, disarm and all of hand().
class SimulatedDevice : public HapticDevice {
 public:
  static constexpr unsigned kLongestWindow = 31;
  static constexpr unsigned kLongestDelay = 7;
  /// [ticks] without a write after which an armed device takes its forces off: Force Dimension's watchdog
  /// ends at 255 x 125 us.
  static constexpr unsigned kWatchdog = 32;

  enum class Phase : std::uint8_t { kClosed, kOpen, kArmed, kFault };

  explicit SimulatedDevice(SimulatedModel model, std::uint64_t seed = 1,
                           std::shared_ptr<MagneticClutch> clutch = nullptr);

  [[nodiscard]] Result<void> open();
  void close() noexcept;

  [[nodiscard]] const DeviceCaps& caps() const override { return model_.caps; }
  [[nodiscard]] Result<void> arm() override;
  void disarm() noexcept override;
  [[nodiscard]] Result<void> resetFault() override;
  void read(DeviceState& state) noexcept override;
  void write(const DeviceCommand& command) noexcept override;

  [[nodiscard]] HumanArm& hand() noexcept { return hand_; }
  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Pulls the plug: the device says nothing more until it is opened again.
  void unplug() noexcept;
  /// What the motors do to the handle now.
  [[nodiscard]] const Wrench& motorWrench() const noexcept { return F_Ho_D_motor_; }

 private:
  void fault(DeviceFault why) noexcept;
  void checkWatchdog() noexcept;
  void checkClutch() noexcept;
  void advance() noexcept;
  [[nodiscard]] Wrench moveHandle(double dt) noexcept;
  [[nodiscard]] Wrench endStops() const noexcept;
  [[nodiscard]] Wrench drivable(const Wrench& F_Ho_D) const noexcept;
  void sense() noexcept;
  [[nodiscard]] Pose counted(const Pose& X_DH) const noexcept;
  [[nodiscard]] double noise() noexcept;
  [[nodiscard]] bool rotates() const noexcept;

  SimulatedModel model_;
  HumanArm hand_;
  std::shared_ptr<MagneticClutch> clutch_;
  std::uint32_t clutch_openings_seen_ = 0;
  std::uint64_t random_;
  Phase phase_ = Phase::kClosed;
  DeviceState state_;
  bool braked_ = false;
  unsigned ticks_since_write_ = 0;

  Pose X_DH_;  ///< of the handle
  Twist V_DH_;
  Wrench F_Ho_D_newest_;  ///< as the motors could do it
  Wrench F_Ho_D_motor_;
  std::array<Wrench, kLongestDelay + 1> commands_{};  ///< by tick modulo its size
  std::array<Pose, kLongestWindow + 1> readings_{};   ///< likewise
};

/// The arm of the person who holds it, or null for a device without a simulated one.
[[nodiscard]] inline HumanArm* handOf(HapticDevice& device) noexcept {
  auto* const simulated = dynamic_cast<SimulatedDevice*>(&device);
  return simulated ? &simulated->hand() : nullptr;
}

}  // namespace tenon
