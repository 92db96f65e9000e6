#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "idl/threads/clock.h"

namespace tenon {

struct CyclicOptions {
  std::string name = "cyclic";  ///< at most 15 characters, as in `top -H`
  Nanoseconds period{1'000'000};
  std::optional<int> fifo_priority;  ///< SCHED_FIFO 1..99
  std::optional<int> cpu;            ///< the only CPU it may run on
};

/// Runs a function once a period, at fixed moments of a clock.
///
/// A tick that starts when the next one is already due is late and counted; the periods it missed are left
/// out, never run in a burst: a device must not see several steps at once. What the operating system did not
/// grant (real-time priority, a CPU) is said in a sentence, and the thread runs on without.
///
/// Threads: start, stop and the destructor from one thread; counters from any.
/// Real-time: the loop, as far as the function is; it must not throw.
class CyclicThread {
 public:
  using Function = std::function<void(std::uint64_t tick)>;

  CyclicThread(std::shared_ptr<Clock> clock, CyclicOptions options, Function function);
  ~CyclicThread();
  CyclicThread(const CyclicThread&) = delete;
  CyclicThread& operator=(const CyclicThread&) = delete;

  /// Returns when the thread has its scheduling. Once only.
  void start();
  /// Ends the loop after the tick that is going on, and joins. May be called again.
  void stop();

  /// Empty when all that was asked for was granted.
  [[nodiscard]] const std::string& notGranted() const { return not_granted_; }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t lateTicks() const { return late_ticks_.load(std::memory_order_relaxed); }
  /// Largest delay of a tick's start after its moment, since the start.
  [[nodiscard]] Nanoseconds worstDelay() const {
    return Nanoseconds(worst_delay_.load(std::memory_order_relaxed));
  }

 private:
  void schedule();
  void loop() noexcept;

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

/// Keeps all memory of this process, now and later, out of swap. Returns what was not granted, or nothing.
[[nodiscard]] std::string lockMemory();

}  // namespace tenon
