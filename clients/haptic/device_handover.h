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
    Result<void> done = device.resetFault();
    served_ = owner_.load(std::memory_order_acquire);
    if (done && served_ == Owner::kToArm) done = device.arm();
    return done;
  }
  /// After serve() of all devices that share a clutch, which serve() of each touches. A request to arm that
  /// came after a reset stays.
  void handBack() noexcept {
    if (served_ == Owner::kToArm) {
      owner_.store(Owner::kServo, std::memory_order_release);
    } else if (served_ == Owner::kToReset) {
      Owner reset = Owner::kToReset;
      owner_.compare_exchange_strong(reset, Owner::kServo, std::memory_order_acq_rel);
    }
    served_ = Owner::kServo;
  }

 private:
  enum class Owner { kServo, kToArm, kToReset };
  std::atomic<Owner> owner_{Owner::kServo};
  Owner served_ = Owner::kServo;  ///< what serve() did; kServo: nothing
};

}  // namespace tenon::haptic
