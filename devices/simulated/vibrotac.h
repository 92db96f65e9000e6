#pragma once

#include <array>
#include <cstdint>

#include "devices/device.h"

namespace tenon {

/// The VibroTac arm band: six vibration motors about the forearm, no pushing force.
///
/// Six tactors, intensity each: [paper]; ERM motors: [published] (SENSODRIVE); 60 ms spin-up, commands at
/// most every 20 ms: [assumed], no data sheet is public. Where the forearm is comes from a tracker, not from
/// the band.
///
/// Threads: one servo thread. Real-time: read, write, disarm.
class Vibrotac : public HapticDevice {
 public:
  static constexpr double kSpinUp = 0.060;          ///< [s] time constant of a motor [assumed]
  static constexpr unsigned kTicksPerCommand = 20;  ///< 50 Hz over a serial radio link [assumed]
  /// [ticks] without a write after which the motors stop.
  static constexpr unsigned kWatchdog = 100;

  Vibrotac();

  [[nodiscard]] const DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override;
  void disarm() noexcept override;
  [[nodiscard]] Result<void> resetFault() override;
  void read(DeviceState& state) noexcept override;
  void write(const DeviceCommand& command) noexcept override;

  /// How strongly each tactor shakes now, 0..1: what the skin feels.
  [[nodiscard]] const std::array<double, 6>& felt() const noexcept { return amplitude_; }

 private:
  DeviceCaps caps_;
  DeviceState state_;
  std::array<std::uint8_t, 6> wanted_{};  ///< newest from the servo
  std::array<std::uint8_t, 6> sent_{};    ///< last that went over the link
  std::array<double, 6> amplitude_{};
  unsigned ticks_to_send_ = 0;
  unsigned ticks_since_write_ = 0;
};

}  // namespace tenon
