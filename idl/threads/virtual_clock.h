#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>

#include "idl/threads/clock.h"

namespace tenon::threads {

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
