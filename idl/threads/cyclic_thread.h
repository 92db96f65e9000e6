#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "idl/threads/clock.h"

namespace tenon::threads {

struct CyclicOptions {
  std::string name = "cyclic";  ///< of the thread, as `top -H` shows it; 15 characters are used
  Nanoseconds period{1'000'000};
  std::optional<int> fifo_priority;  ///< SCHED_FIFO 1..99; none: default scheduling
  std::optional<int> cpu;            ///< pinned to this CPU; none: any
  /// Called once on the thread, when its scheduling is set and before its first tick; may be empty. Returns
  /// what the operating system did not grant, for notGranted().
  std::function<std::string()> prepare;
  /// What paces the ticks, as a device by its readings; empty: the clock alone. Waits for its next event,
  /// `longest` at most, and returns whether there is one; false at once where none can come.
  std::function<bool(Nanoseconds longest)> await;
};

/// Calls a function periodically at fixed times of a clock.
///
/// A tick that starts a period or more after its due time is late and counted; missed periods are skipped and
/// not caught up, because a device must not get several steps at once.
///
/// With CyclicOptions::await a tick begins when the event has come, not before three quarters of a period.
/// One that is late is waited for kPatience periods more; from then on the clock paces, until there is one
/// again.
///
/// Scheduling that the operating system does not grant (real-time priority, CPU) is reported by notGranted(),
/// and the thread runs without it.
///
/// Threads: start, stop and the destructor from one thread; counters from any.
/// Real-time: the loop, as far as the function is; it must not throw.
class CyclicThread {
 public:
  using Function = std::function<void(std::uint64_t tick)>;
  static constexpr int kPatience = 2;  ///< [periods]

  CyclicThread(std::shared_ptr<Clock> clock, CyclicOptions options, Function function);
  ~CyclicThread();
  CyclicThread(const CyclicThread&) = delete;
  CyclicThread& operator=(const CyclicThread&) = delete;

  /// Starts the thread; returns when its scheduling is set. Once only.
  void start();
  /// Ends the loop after the current tick and joins the thread. May be called repeatedly.
  void stop();

  /// What the operating system did not grant, in words; empty: everything was granted.
  [[nodiscard]] const std::string& notGranted() const { return not_granted_; }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t lateTicks() const { return late_ticks_.load(std::memory_order_relaxed); }
  /// Largest delay of a tick's start after its due time.
  [[nodiscard]] Nanoseconds worstDelay() const {
    return Nanoseconds(worst_delay_.load(std::memory_order_relaxed));
  }

 private:
  void schedule();
  void loop() noexcept;
  /// For the tick that is due at `due`. `has_come`: the last one began with an event.
  [[nodiscard]] bool awaitEvent(Nanoseconds due, bool has_come) const noexcept;

  std::shared_ptr<Clock> clock_;
  CyclicOptions options_;
  Function function_;
  std::string not_granted_;
  std::atomic<bool> ready_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<std::uint64_t> ticks_{0};
  std::atomic<std::uint64_t> late_ticks_{0};
  std::atomic<std::int64_t> worst_delay_{0};
  std::thread thread_;
};

/// Locks all present and future memory of the process in RAM (mlockall). Returns why that failed, or an empty
/// string.
[[nodiscard]] std::string lockMemory();

}  // namespace tenon::threads
