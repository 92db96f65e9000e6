#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

namespace tenon::simulation {

/// Thread pool for the independent items of one tick; the calling thread is one of the workers.
///
/// Which worker processes which item is not determined, so an item may write only its own data. Idle workers
/// spin briefly, then sleep on a futex. A pool of one worker starts no thread.
///
/// Threads: run() from one thread. Real-time: run() (wakes sleeping workers; no allocation, no lock).
class WorkerPool {
 public:
  explicit WorkerPool(unsigned workers);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  [[nodiscard]] unsigned workers() const { return static_cast<unsigned>(threads_.size()) + 1; }

  /// Gives the threads the scheduling of the calling thread, which is to call run()
  /// (idl/threads/scheduling.h). Returns what the operating system did not grant, or an empty string. Not
  /// real-time.
  [[nodiscard]] std::string shareScheduling();

  static constexpr std::size_t kMaxItems = 0xFFFF;

  /// Calls work(worker, item) once for every item < items, at most kMaxItems, and returns when all are done.
  template <typename Work>
  void run(std::size_t items, Work& work) noexcept {
    runErased(
        items,
        [](void* context, unsigned worker, std::size_t item) {
          (*static_cast<Work*>(context))(worker, item);
        },
        &work);
  }

 private:
  using Call = void (*)(void* context, unsigned worker, std::size_t item);

  void runErased(std::size_t items, Call call, void* context) noexcept;
  void work(unsigned worker) noexcept;
  void takeItems(unsigned worker) noexcept;

  std::vector<std::thread> threads_;
  Call call_ = nullptr;
  void* context_ = nullptr;
  /// Run number (32 bits), number of items (16) and next item (16) in one word, so that a late worker cannot
  /// take an item of a run whose start it has not observed.
  std::atomic<std::uint64_t> ticket_{0};
  std::atomic<std::uint32_t> done_{0};
  std::atomic<std::uint32_t> wake_{0};
  std::atomic<bool> stop_{false};
};

}  // namespace tenon::simulation
