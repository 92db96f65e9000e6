#include "idl/threads/clock.h"

#include <ctime>

namespace tenon::threads {

Nanoseconds SteadyClock::now() const noexcept {
  timespec spec{};
  clock_gettime(CLOCK_MONOTONIC, &spec);
  return std::chrono::seconds(spec.tv_sec) + Nanoseconds(spec.tv_nsec);
}

void SteadyClock::sleepUntil(Nanoseconds time, const std::atomic<bool>&) noexcept {
  timespec spec{};
  spec.tv_sec = static_cast<time_t>(time.count() / 1'000'000'000);
  spec.tv_nsec = static_cast<long>(time.count() % 1'000'000'000);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &spec, nullptr);
}

}  // namespace tenon::threads
