#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "devices/device.h"

namespace tenon::devices {

/// VibroTac bracelet: six vibration motors around the forearm, no force.
///
/// Six tactors of individual intensity: [paper]. Motors with eccentric rotating mass: [published]
/// (SENSODRIVE). Spin-up of 60 ms and one command per 20 ms: [assumed], because no data sheet is public. The
/// forearm's pose comes from a tracker, not from the bracelet.
///
/// Threads: one servo thread. Real-time: read, write, disarm.
class Vibrotac : public HapticDevice {
 public:
  static constexpr double kSpinUp = 0.060;          ///< [s] time constant of a motor [assumed]
  static constexpr unsigned kTicksPerCommand = 20;  ///< 50 Hz over a serial radio link [assumed]
  /// [ticks] without a write until the motors stop.
  static constexpr unsigned kWatchdog = 100;

  explicit Vibrotac(std::string serial = {});

  [[nodiscard]] const DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override;
  void disarm() noexcept override;
  [[nodiscard]] Result<void> resetFault() override;
  void read(DeviceState& state) noexcept override;
  void write(const DeviceCommand& command) noexcept override;

  /// [-] vibration amplitude of each tactor, 0 to 1.
  [[nodiscard]] const std::array<double, 6>& amplitudes() const noexcept { return amplitude_; }

 private:
  DeviceCaps caps_;
  DeviceState state_;
  std::array<std::uint8_t, 6> requested_{};  ///< newest command of the servo
  std::array<std::uint8_t, 6> sent_{};       ///< last command sent over the link
  std::array<double, 6> amplitude_{};        ///< [-] 0 to 1
  unsigned ticks_to_send_ = 0;
  unsigned ticks_since_write_ = 0;
};

}  // namespace tenon::devices
