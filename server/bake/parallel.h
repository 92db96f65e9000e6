#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <string_view>
#include <thread>
#include <vector>

#include "server/bake/bake.h"

namespace tenon {

/// Shares numbered pieces of work among this machine's cores and tells a person how far it is.
///
/// Each piece writes only what is its own, so the result is the same for any number of threads. `progress` is
/// called on the thread that called run(), and once it returns false no further piece is begun.
class ParallelWork {
 public:
  explicit ParallelWork(const BakeProgress& progress)
      : progress_(progress), threads_(std::clamp(std::thread::hardware_concurrency(), 1U, 8U)) {}

  /// What the following runs do, and from which to which share of the whole.
  void stage(std::string_view doing, double from, double to) {
    doing_ = doing;
    from_ = from;
    to_ = to;
    report(0.0);
  }

  [[nodiscard]] bool cancelled() const { return cancelled_; }

  /// Calls work(i) for every i < count; neighbours in i go to one thread in blocks of `grain`.
  template <typename Work>
  void run(std::size_t count, std::size_t grain, Work&& work) {
    if (cancelled_ || count == 0) return;
    std::atomic<std::size_t> next{0};
    const auto loop = [&](bool reports) {
      while (!cancelled_) {
        const std::size_t begin = next.fetch_add(grain);
        if (begin >= count) return;
        const std::size_t end = std::min(count, begin + grain);
        for (std::size_t i = begin; i < end; ++i) work(i);
        if (reports) report(static_cast<double>(end) / static_cast<double>(count));
      }
    };
    std::vector<std::jthread> helpers;
    const std::size_t useful = std::min<std::size_t>(threads_, (count + grain - 1) / grain);
    for (std::size_t i = 1; i < useful; ++i) helpers.emplace_back(loop, false);
    loop(true);
  }

 private:
  void report(double share_of_stage) {
    if (progress_ && !progress_(from_ + (to_ - from_) * share_of_stage, doing_)) cancelled_ = true;
  }

  const BakeProgress& progress_;
  unsigned threads_;
  std::string_view doing_;
  double from_ = 0.0;
  double to_ = 0.0;
  std::atomic<bool> cancelled_{false};
};

}  // namespace tenon
