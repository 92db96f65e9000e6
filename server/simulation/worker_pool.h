#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

namespace tenon {

/// Shares the independent items of one tick among threads, the caller included.
///
/// Items are taken by index; which worker takes which is left to chance, so an item may write only what is
/// its own. Idle workers spin briefly, then sleep on a futex; with one worker there is no thread at all.
///
/// Threads: run() from one thread. Real-time: run() (wakes sleepers, allocates and locks nothing).
class WorkerPool {
 public:
  explicit WorkerPool(unsigned workers);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  [[nodiscard]] unsigned workers() const { return static_cast<unsigned>(threads_.size()) + 1; }

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
  /// Run number (32 bits), items (16), next item (16): in one word, so a late worker never takes an item of a
  /// run it has not seen begin.
  std::atomic<std::uint64_t> ticket_{0};
  std::atomic<std::uint32_t> done_{0};
  std::atomic<std::uint32_t> wake_{0};
  std::atomic<bool> stop_{false};
};

}  // namespace tenon
