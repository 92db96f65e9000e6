#include "idl/threads/clock.h"

#include <ctime>

namespace tenon {

Nanoseconds SteadyClock::now() const noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::chrono::seconds(time.tv_sec) + Nanoseconds(time.tv_nsec);
}

void SteadyClock::sleepUntil(Nanoseconds moment, const std::atomic<bool>&) noexcept {
  timespec time{};
  time.tv_sec = static_cast<time_t>(moment.count() / 1'000'000'000);
  time.tv_nsec = static_cast<long>(moment.count() % 1'000'000'000);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr);
}

Nanoseconds VirtualClock::now() const noexcept {
  const std::lock_guard<std::mutex> lock(mutex_);
  return now_;
}

void VirtualClock::sleepUntil(Nanoseconds moment, const std::atomic<bool>& stop) noexcept {
  std::unique_lock<std::mutex> lock(mutex_);
  asleep_until_ = moment;
  asleep_ = true;
  slept_.notify_all();
  moved_.wait(lock, [&] { return now_ >= moment || stop.load(std::memory_order_acquire); });
  asleep_ = false;
}

void VirtualClock::interrupt() noexcept {
  const std::lock_guard<std::mutex> lock(mutex_);
  moved_.notify_all();
}

void VirtualClock::advance(Nanoseconds by) {
  const std::lock_guard<std::mutex> lock(mutex_);
  now_ += by;
  moved_.notify_all();
}

void VirtualClock::waitUntilAsleep() {
  std::unique_lock<std::mutex> lock(mutex_);
  slept_.wait(lock, [&] { return asleep_ && asleep_until_ > now_; });
}

}  // namespace tenon
