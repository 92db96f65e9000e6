#pragma once

#include <atomic>

#include "devices/device.h"

namespace tenon::haptic {

/// Arming of a device outside of the servo thread, since it may block and make texts. While it is asked for,
/// the servo thread does not touch the device, which is not armed and displays no force.
///
/// Threads: ask and pending by the servo thread, serve by another one. Real-time: ask, pending.
class DeviceHandover {
 public:
  /// To be armed, after a reset of its fault: the person at the device has pressed for it.
  void ask() noexcept { asked_.store(true, std::memory_order_release); }
  /// True: the device is not to be read or written.
  [[nodiscard]] bool pending() const noexcept { return asked_.load(std::memory_order_acquire); }
  /// Does what was asked for, and hands the device back. Fails with what the device says.
  Result<void> serve(devices::HapticDevice& device) {
    if (!pending()) return {};
    Result<void> armed = device.resetFault();
    if (armed) armed = device.arm();
    asked_.store(false, std::memory_order_release);
    return armed;
  }

 private:
  std::atomic<bool> asked_{false};
};

}  // namespace tenon::haptic
