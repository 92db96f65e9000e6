#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <string_view>
#include <thread>
#include <vector>

#include "server/bake/bake.h"

namespace tenon::bake {

/// A parallel for loop over this machine's cores (at most 8) with progress reports.
///
/// Each iteration writes only its own data, so the result is the same for any number of threads. `progress`
/// is called on the thread that called run(); once it returns false no further iteration is started.
///
/// Threads: one caller; cancelled() also from the iterations.
class ParallelWork {
 public:
  explicit ParallelWork(const BakeProgress& progress)
      : progress_(progress), threads_(std::clamp(std::thread::hardware_concurrency(), 1U, 8U)) {}

  /// The name of the stage that the following runs belong to. Their progress goes from the fraction `from`
  /// [-] to the fraction `to` [-] of the whole.
  void stage(std::string_view stage_name, double from, double to) {
    stage_ = stage_name;
    from_ = from;
    to_ = to;
    report(0.0);
  }

  [[nodiscard]] bool cancelled() const { return cancelled_; }

  /// Calls work(i) for every i < count, unless cancelled; a thread takes `grain` consecutive i at a time.
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
    const std::size_t threads = std::min<std::size_t>(threads_, (count + grain - 1) / grain);
    for (std::size_t i = 1; i < threads; ++i) helpers.emplace_back(loop, false);
    loop(true);
  }

 private:
  /// `fraction_of_stage` [-]
  void report(double fraction_of_stage) {
    if (progress_ && !progress_(from_ + (to_ - from_) * fraction_of_stage, stage_)) cancelled_ = true;
  }

  const BakeProgress& progress_;
  unsigned threads_;
  std::string_view stage_;
  double from_ = 0.0;  ///< [-]
  double to_ = 0.0;    ///< [-]
  std::atomic<bool> cancelled_{false};
};

}  // namespace tenon::bake
