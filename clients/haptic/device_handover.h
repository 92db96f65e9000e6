#pragma once

#include <atomic>

#include "devices/device.h"

namespace tenon::haptic {

/// Arming of a device outside of the servo thread, since it may block and make texts. From the request until
/// the device is handed back the servo thread does not touch it; it displays no force meanwhile.
///
/// Threads: ask, withdraw and pending by the servo thread, serve and handBack by another one. Real-time: ask,
/// withdraw, pending.
class DeviceHandover {
 public:
  /// To be armed, after a reset of its fault: the person at the device has pressed for it.
  void ask() noexcept { owner_.store(Owner::kToArm, std::memory_order_release); }
  /// A stop has come: the device is handed back unarmed, unless arm() has begun.
  void withdraw() noexcept {
    Owner asked = Owner::kToArm;
    owner_.compare_exchange_strong(asked, Owner::kToReset, std::memory_order_acq_rel);
  }
  /// True: the device is not to be read or written.
  [[nodiscard]] bool pending() const noexcept {
    return owner_.load(std::memory_order_acquire) != Owner::kServo;
  }
  /// Does what was asked for. Fails with what the device says.
  Result<void> serve(devices::HapticDevice& device) {
    if (!pending()) return {};
    served_ = true;
    Result<void> done = device.resetFault();
    if (done && owner_.load(std::memory_order_acquire) == Owner::kToArm) done = device.arm();
    return done;
  }
  /// After serve() of all devices that share a clutch, which serve() of each touches.
  void handBack() noexcept {
    if (served_) owner_.store(Owner::kServo, std::memory_order_release);
    served_ = false;
  }

 private:
  enum class Owner { kServo, kToArm, kToReset };
  std::atomic<Owner> owner_{Owner::kServo};
  bool served_ = false;
};

}  // namespace tenon::haptic
