#include "server/simulation/worker_pool.h"

#include <algorithm>
#include <cassert>

#include "idl/threads/scheduling.h"

namespace tenon::simulation {
namespace {

/// Some tens of microseconds: longer than the islands of one tick differ, shorter than the pause to the next.
constexpr int kSpins = 2000;

constexpr unsigned kItemsShift = 16;
constexpr unsigned kRunShift = 32;
constexpr std::uint64_t kItemMask = 0xFFFF;

void pause() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

/// Waits until `value` differs from `old`: spinning at first, then on a futex.
void waitWhile(std::atomic<std::uint32_t>& value, std::uint32_t old) noexcept {
  for (int spin = 0; spin < kSpins; ++spin) {
    if (value.load(std::memory_order_acquire) != old) return;
    pause();
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

WorkerPool::WorkerPool(unsigned workers) {
  for (unsigned worker = 1; worker < std::max(workers, 1U); ++worker) {
    threads_.emplace_back([this, worker] {
      threads::nameThisThread("tick worker " + std::to_string(worker));
      work(worker);
    });
  }
  // a thread allocates and locks while it starts: that is over before the first run
  for (std::uint32_t running = done_.load(std::memory_order_acquire); running < threads_.size();
       running = done_.load(std::memory_order_acquire)) {
    waitWhile(done_, running);
  }
}

WorkerPool::~WorkerPool() {
  stop_.store(true, std::memory_order_release);
  wake_.fetch_add(1, std::memory_order_acq_rel);
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

std::string WorkerPool::shareScheduling() { return threads::shareScheduling(threads_); }

void WorkerPool::runErased(std::size_t items, Call call, void* context) noexcept {
  assert(items <= kMaxItems);
  if (threads_.empty() || items <= 1) {
    for (std::size_t item = 0; item < items; ++item) call(context, 0, item);
    return;
  }
  call_ = call;
  context_ = context;
  done_.store(0, std::memory_order_relaxed);
  const std::uint64_t run = (ticket_.load(std::memory_order_relaxed) >> kRunShift) + 1;
  ticket_.store(run << kRunShift | items << kItemsShift, std::memory_order_release);
  wake_.fetch_add(1, std::memory_order_acq_rel);
  wake_.notify_all();

  takeItems(0);
  for (std::uint32_t done = done_.load(std::memory_order_acquire); done < items;
       done = done_.load(std::memory_order_acquire)) {
    waitWhile(done_, done);
  }
}

void WorkerPool::takeItems(unsigned worker) noexcept {
  std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
  for (;;) {
    const std::uint64_t items = ticket >> kItemsShift & kItemMask;
    const std::uint64_t item = ticket & kItemMask;
    if (item >= items) return;
    if (!ticket_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel,
                                       std::memory_order_acquire)) {
      continue;
    }
    // the run cannot end before this item is counted as done, so call_ and context_ are valid
    call_(context_, worker, item);
    if (done_.fetch_add(1, std::memory_order_acq_rel) + 1 == items) done_.notify_one();
    ticket = ticket_.load(std::memory_order_acquire);
  }
}

void WorkerPool::work(unsigned worker) noexcept {
  done_.fetch_add(1, std::memory_order_acq_rel);
  done_.notify_one();
  std::uint32_t seen = wake_.load(std::memory_order_acquire);
  while (!stop_.load(std::memory_order_acquire)) {
    takeItems(worker);
    waitWhile(wake_, seen);
    seen = wake_.load(std::memory_order_acquire);
  }
}

}  // namespace tenon::simulation
