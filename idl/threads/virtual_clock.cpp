#include "idl/threads/virtual_clock.h"

namespace tenon::threads {

Nanoseconds VirtualClock::now() const noexcept {
  const std::lock_guard<std::mutex> lock(mutex_);
  return now_;
}

void VirtualClock::sleepUntil(Nanoseconds time, const std::atomic<bool>& stop) noexcept {
  std::unique_lock<std::mutex> lock(mutex_);
  asleep_until_ = time;
  asleep_ = true;
  fell_asleep_.notify_all();
  advanced_.wait(lock, [&] { return now_ >= time || stop.load(std::memory_order_acquire); });
  asleep_ = false;
}

void VirtualClock::interrupt() noexcept {
  const std::lock_guard<std::mutex> lock(mutex_);
  advanced_.notify_all();
}

void VirtualClock::advance(Nanoseconds by) {
  const std::lock_guard<std::mutex> lock(mutex_);
  now_ += by;
  advanced_.notify_all();
}

void VirtualClock::waitUntilAsleep() {
  std::unique_lock<std::mutex> lock(mutex_);
  fell_asleep_.wait(lock, [&] { return asleep_ && asleep_until_ > now_; });
}

}  // namespace tenon::threads
