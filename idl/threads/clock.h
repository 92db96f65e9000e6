#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

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

/// Virtual time that changes only by advance(), for one sleeping thread. Real-time: no.
class VirtualClock : public Clock {
 public:
  [[nodiscard]] Nanoseconds now() const noexcept override;
  void sleepUntil(Nanoseconds time, const std::atomic<bool>& stop) noexcept override;
  void interrupt() noexcept override;

  void advance(Nanoseconds by);
  /// Blocks until the thread of this clock sleeps until a time after now(): all work due so far is done.
  void waitUntilAsleep();

 private:
  mutable std::mutex mutex_;
  std::condition_variable advanced_;
  std::condition_variable fell_asleep_;
  Nanoseconds now_{0};
  Nanoseconds asleep_until_{0};
  bool asleep_ = false;
};

}  // namespace tenon::threads
