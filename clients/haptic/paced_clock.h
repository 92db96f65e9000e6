#pragma once

#include <atomic>

#include "devices/device.h"
#include "idl/threads/clock.h"

namespace tenon::haptic {

/// Clock of a servo loop that a device paces: a period passes with each reading. A device that falls silent
/// is late, and does not stop the loop.
///
/// Threads: as Clock. Real-time: as HapticDevice::await.
class PacedClock final : public threads::Clock {
 public:
  /// `device` outlives it.
  PacedClock(devices::HapticDevice& device, threads::Nanoseconds period) : device_(device), period_(period) {}

  [[nodiscard]] threads::Nanoseconds now() const noexcept override {
    return threads::Nanoseconds(now_.load(std::memory_order_relaxed));
  }
  void sleepUntil(threads::Nanoseconds time, const std::atomic<bool>& stop) noexcept override {
    while (now() < time && !stop) {
      device_.await();
      now_.fetch_add(period_.count(), std::memory_order_relaxed);
    }
  }
  void interrupt() noexcept override {}  // await() ends by itself

 private:
  devices::HapticDevice& device_;
  threads::Nanoseconds period_;
  std::atomic<threads::Nanoseconds::rep> now_{0};
};

}  // namespace tenon::haptic
