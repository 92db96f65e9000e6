#pragma once

#include <atomic>
#include <chrono>

namespace tenon::threads {

using Nanoseconds = std::chrono::nanoseconds;

/// Time source of a loop, so that tests and whole sessions can run on virtual time.
///
/// Threads: any. Real-time: see the implementations.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Time since an arbitrary fixed point; monotonic.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
  /// Returns at `time` or earlier; in any case soon after `stop` is set and interrupt() was called. The
  /// caller checks now() again.
  virtual void sleepUntil(Nanoseconds time, const std::atomic<bool>& stop) noexcept = 0;
  /// Wakes sleepers; to be called after setting their `stop`.
  virtual void interrupt() noexcept = 0;
};

/// The machine's monotonic clock. Real-time: yes (a sleep is one system call).
class SteadyClock : public Clock {
 public:
  [[nodiscard]] Nanoseconds now() const noexcept override;
  void sleepUntil(Nanoseconds time, const std::atomic<bool>& stop) noexcept override;
  void interrupt() noexcept override {}  // sleeps are at most one period: no need to wake
};

}  // namespace tenon::threads
