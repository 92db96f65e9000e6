#pragma once

#include "clients/haptic/device_handover.h"
#include "devices/device.h"
#include "devices/safety.h"

namespace tenon::haptic {

/// A device behind its safety layer: its person arms it, a stop or the end of a session takes that away. What
/// a hand and a bracelet have in common, whatever they display.
///
/// Threads: one; armDevice and handBack by another one, beside it. Real-time: finish, and what is protected
/// but begin.
class GuardedDevice {
 public:
  GuardedDevice(const GuardedDevice&) = delete;
  GuardedDevice& operator=(const GuardedDevice&) = delete;

  /// Whether there is something for armDevice() to do.
  [[nodiscard]] bool wantsArming() const noexcept { return handover_.pending(); }
  /// Does what was asked for, resets and arms the device; may block. The loop has the device again
  /// after handBack(), which follows armDevice() of all that share its clutch.
  Result<void> armDevice() { return handover_.serve(device_); }
  void handBack() noexcept { handover_.handBack(); }
  /// With the next steps it displays less and less, then nothing, and with `disarms` it is disarmed. Nothing
  /// ends that but a new begin().
  void finish(bool disarms) noexcept {
    finishing_ = true;
    finish_disarms_ = disarms;
    if (disarms) handover_.withdraw();
  }
  /// Forces off.
  void end() noexcept { device_.disarm(); }

 protected:
  /// `device` and `clutch` outlive it.
  explicit GuardedDevice(devices::HapticDevice& device, devices::ClutchLatch* clutch = nullptr)
      : device_(device), safety_(device.caps(), clutch) {}
  ~GuardedDevice() = default;

  /// Reads `state`. Not `armed`, the device is disarmed; else one that has no forces on is to be armed by
  /// armDevice(), unless it is in fault.
  void begin(bool armed, devices::DeviceState& state) {
    permitted_ = armed;
    finishing_ = false;
    if (!armed) device_.disarm();
    device_.read(state);
    if (armed && !state.forces_on) handover_.askWithoutReset();
  }
  /// False: a stop. True, for the person at the device, also of one in fault: unless it displays forces, as
  /// `forces_on` says, its safety layer is reset, and it is to be armed; then it returns true.
  bool permit(bool permitted, bool forces_on) noexcept {
    const bool runs = permitted_ && forces_on && !safety_.wantsDisarm();
    permitted_ = permitted;
    if (!permitted) handover_.withdraw();
    if (!permitted || runs || finishing_) return false;
    safety_.reset();
    handover_.ask();
    return true;
  }
  /// `is_silent`: after finish(), it displays nothing any more.
  void write(const devices::DeviceCommand& command, bool is_silent) noexcept {
    device_.write(command);  // a stop brakes before the forces are off
    if (safety_.wantsDisarm() || (is_silent && finish_disarms_)) device_.disarm();
  }

  devices::HapticDevice& device_;
  devices::Safety safety_;
  DeviceHandover handover_;
  bool permitted_ = false;
  bool finishing_ = false;

 private:
  bool finish_disarms_ = false;
};

}  // namespace tenon::haptic
