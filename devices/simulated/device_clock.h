#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <utility>

#include "idl/threads/clock.h"
#include "idl/types/random.h"

namespace tenon::devices {

/// Clock of a simulated device's controller: a reading each millisecond, by a crystal that is off by up to
/// 50 ppm, which arrives up to 100 us late [assumed: USB full speed, quartz].
///
/// Threads: one. Real-time: everything but the constructor, as far as the clock is.
class DeviceClock {
 public:
  /// `clock` is that of the machine, by which it waits; crystal and delays come from `seed`.
  DeviceClock(std::shared_ptr<threads::Clock> clock, std::uint64_t seed)
      : clock_(std::move(clock)), random_(seed) {
    period_ = threads::Nanoseconds(1'000'000 + std::int64_t(random_.uniform(-50.0, 50.0)));
  }

  /// HapticDevice::awaitReading. The first call starts it.
  [[nodiscard]] bool await(std::chrono::nanoseconds longest) noexcept {
    const threads::Nanoseconds until = clock_->now() + longest;
    if (measured_ == threads::Nanoseconds::zero()) schedule(clock_->now());
    const std::atomic<bool> never{false};
    while (!has_reading_ && clock_->now() < std::min(arrives_, until))
      clock_->sleepUntil(std::min(arrives_, until), never);
    has_reading_ = has_reading_ || clock_->now() >= arrives_;
    return has_reading_;
  }
  /// The newest reading is taken: those that nobody took are lost.
  void taken() noexcept {
    if (std::exchange(has_reading_, false)) schedule(clock_->now());
  }

 private:
  /// The next reading after `now`.
  void schedule(threads::Nanoseconds now) noexcept {
    if (measured_ == threads::Nanoseconds::zero()) measured_ = now;
    measured_ += period_ * (1 + std::max(threads::Nanoseconds::zero(), now - measured_) / period_);
    arrives_ = measured_ + threads::Nanoseconds(std::int64_t(random_.uniform(0.0, 100'000.0)));
  }

  std::shared_ptr<threads::Clock> clock_;
  Random random_;
  threads::Nanoseconds period_{};
  threads::Nanoseconds measured_{};  ///< of the newest reading, on clock_; zero: it has not begun
  threads::Nanoseconds arrives_{};
  bool has_reading_ = false;
};

}  // namespace tenon::devices
