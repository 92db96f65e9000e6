#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace tenon {

using Nanoseconds = std::chrono::nanoseconds;

/// Where a loop gets its time from, so that a test or a whole session can run on a virtual one.
///
/// Threads: any. Real-time: see the implementations.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Since some fixed moment; never goes back.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
  /// Returns at `moment`, or earlier once `stop` is set: look at now() again.
  virtual void sleepUntil(Nanoseconds moment, const std::atomic<bool>& stop) noexcept = 0;
  /// To be called after setting `stop`.
  virtual void interrupt() noexcept = 0;
};

/// The machine's monotonic clock. Real-time: yes (a sleep is one system call).
class SteadyClock : public Clock {
 public:
  [[nodiscard]] Nanoseconds now() const noexcept override;
  void sleepUntil(Nanoseconds moment, const std::atomic<bool>& stop) noexcept override;
  void interrupt() noexcept override {}  // a period is short: the sleeper looks by itself
};

/// Stands still until someone moves it. Real-time: no (it is for tests and for sessions on virtual time).
class VirtualClock : public Clock {
 public:
  [[nodiscard]] Nanoseconds now() const noexcept override;
  void sleepUntil(Nanoseconds moment, const std::atomic<bool>& stop) noexcept override;
  void interrupt() noexcept override;

  void advance(Nanoseconds by);
  /// Returns when the one thread of this clock sleeps towards a later moment: what the last advance started
  /// has happened.
  void waitUntilAsleep();

 private:
  mutable std::mutex mutex_;
  std::condition_variable moved_;
  std::condition_variable slept_;
  Nanoseconds now_{0};
  Nanoseconds asleep_until_{0};
  bool asleep_ = false;
};

}  // namespace tenon
