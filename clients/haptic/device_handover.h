#pragma once

#include <atomic>

#include "devices/device.h"

namespace tenon::haptic {

/// Arming of a device outside of the servo thread, since it may block and make texts. From the request until
/// the device is handed back the servo thread does not touch it; it displays no force meanwhile.
///
/// Threads: ask, withdraw and pending by the servo thread, or by another one before the loop begins; serve
/// and handBack by another one. Real-time: ask, withdraw, pending.
class DeviceHandover {
 public:
  /// To be armed, after a reset of its fault: the person at the device has pressed for it.
  void ask() noexcept { asked_.store(kPending | kReset | kArm, std::memory_order_release); }
  /// To be armed unless it is in fault: the person has pressed before the hand had the device.
  void askWithoutReset() noexcept { asked_.store(kPending | kArm, std::memory_order_release); }
  /// A stop has come: the device is handed back unarmed, unless arm() has begun.
  void withdraw() noexcept { asked_.fetch_and(~kArm, std::memory_order_acq_rel); }
  /// True: the device is not to be read or written.
  [[nodiscard]] bool pending() const noexcept { return asked_.load(std::memory_order_acquire) != 0; }
  /// Does what was asked for. Fails with what the device says.
  Result<void> serve(devices::HapticDevice& device) {
    served_ = asked_.load(std::memory_order_acquire);
    if (served_ == 0) return {};
    Result<void> done;
    if ((served_ & kReset) != 0) done = device.resetFault();
    served_ &= asked_.load(std::memory_order_acquire) | kReset;
    if (done && (served_ & kArm) != 0) done = device.arm();
    return done;
  }
  /// After serve() of all devices that share a clutch, which serve() of each touches. A request that came
  /// after it and asks for more stays.
  void handBack() noexcept {
    if (served_ == 0) return;
    unsigned asked = asked_.load(std::memory_order_acquire);
    if ((asked & ~served_) == 0) asked_.compare_exchange_strong(asked, 0, std::memory_order_acq_rel);
    served_ = 0;
  }

 private:
  static constexpr unsigned kPending = 1;
  static constexpr unsigned kReset = 2;
  static constexpr unsigned kArm = 4;
  std::atomic<unsigned> asked_{0};
  unsigned served_ = 0;  ///< what serve() did; 0: nothing
};

}  // namespace tenon::haptic
