#include "clients/haptic/servo_thread.h"

#include <chrono>
#include <thread>

namespace tenon::haptic {

namespace {
constexpr int kServoPriority = 75;
constexpr int kFinishTime = 200;  // [ms] to take the forces away, at most
}  // namespace

void ServoThread::start() {
  threads::CyclicOptions cyclic;
  cyclic.name = "servo";
  if (real_time_) cyclic.fifo_priority = kServoPriority;
  if (!station_.pacedBy().empty())
    cyclic.await = [this](threads::Nanoseconds longest) noexcept { return station_.awaitReading(longest); };
  thread_.emplace(clock_, cyclic, [this](std::uint64_t) noexcept { loop_.cycle(); });
  thread_->start();
}

void ServoThread::stop(bool disarms) {
  loop_.finish(disarms);
  for (int i = 0; i < kFinishTime && !loop_.finished(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  thread_.reset();
  loop_.restart();
}

}  // namespace tenon::haptic
