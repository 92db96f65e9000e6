#include "idl/threads/cyclic_thread.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include "idl/threads/scheduling.h"

namespace tenon::threads {

CyclicThread::CyclicThread(std::shared_ptr<Clock> clock, CyclicOptions options, Function function)
    : clock_(std::move(clock)), options_(std::move(options)), function_(std::move(function)) {}

CyclicThread::~CyclicThread() { stop(); }

void CyclicThread::start() {
  thread_ = std::thread([this] {
    schedule();
    ready_.store(true, std::memory_order_release);
    ready_.notify_one();
    loop();
  });
  ready_.wait(false, std::memory_order_acquire);
}

void CyclicThread::stop() {
  stopping_.store(true, std::memory_order_release);
  if (!thread_.joinable()) return;
  clock_->interrupt();
  thread_.join();
}

void CyclicThread::schedule() {
  const auto add = [this](const std::string& sentence) {
    if (!not_granted_.empty() && !sentence.empty()) not_granted_ += "; ";
    not_granted_ += sentence;
  };
  const auto refuse = [&](const std::string& what, int error) {
    add("thread '" + options_.name + "' runs without " + what + " (" + std::strerror(error) + ")");
  };
  nameThisThread(options_.name);
  if (options_.cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    if (*options_.cpu >= 0 && *options_.cpu < CPU_SETSIZE) CPU_SET(*options_.cpu, &cpus);
    const int error = pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus);
    if (error != 0) refuse("CPU " + std::to_string(*options_.cpu) + " of its own", error);
  }
  if (options_.fifo_priority) {
    sched_param parameter{};
    parameter.sched_priority = *options_.fifo_priority;
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
    if (error != 0) refuse("real-time priority " + std::to_string(*options_.fifo_priority), error);
  }
  if (options_.prepare) add(options_.prepare());
}

bool CyclicThread::awaitEvent(Nanoseconds due, bool has_come) const noexcept {
  if (!options_.await) return false;
  const Nanoseconds until = due + (has_come ? kPatience : 0) * options_.period;
  return options_.await(std::max(Nanoseconds::zero(), until - clock_->now()));
}

void CyclicThread::loop() noexcept {
  const Nanoseconds period = options_.period;
  Nanoseconds due = clock_->now() + period;
  bool has_come = true;
  std::uint64_t tick = 0;
  while (!stopping_.load(std::memory_order_acquire)) {
    has_come = awaitEvent(due, has_come);
    const Nanoseconds earliest = has_come ? due - period / 4 : due;
    if (!has_come || clock_->now() < earliest) clock_->sleepUntil(earliest, stopping_);
    const Nanoseconds now = clock_->now();
    if (now < earliest) continue;
    const Nanoseconds delay = std::max(Nanoseconds::zero(), now - due);
    if (delay.count() > worst_delay_.load(std::memory_order_relaxed)) {
      worst_delay_.store(delay.count(), std::memory_order_relaxed);
    }
    if (delay >= period) late_ticks_.fetch_add(1, std::memory_order_relaxed);
    function_(tick);
    ++tick;
    ticks_.store(tick, std::memory_order_relaxed);
    // of the clock's grid, the next due time: missed periods are skipped
    due = has_come ? now + period : due + period * (1 + delay / period);
  }
}

std::string lockMemory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
  return std::string("memory is not locked (") + std::strerror(errno) + "): page faults may delay ticks";
}

}  // namespace tenon::threads
