#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <sys/resource.h>

namespace tenon::bench {

/// Percentiles of a list of times.
struct Percentiles {
  double median = 0.0;  ///< [us]
  double p90 = 0.0;     ///< [us]
  double p99 = 0.0;     ///< [us]
  double p999 = 0.0;    ///< [us] 99.9 %
  double max = 0.0;     ///< [us]
};

/// All 0 for an empty list.
[[nodiscard]] inline Percentiles percentilesOf(std::vector<double> microseconds) {
  if (microseconds.empty()) return {};
  std::sort(microseconds.begin(), microseconds.end());
  const auto at = [&microseconds](std::size_t per_mille) {
    return microseconds[per_mille * (microseconds.size() - 1) / 1000];
  };
  return {at(500), at(900), at(990), at(999), microseconds.back()};
}

/// [us] Duration of one call.
template <typename Work>
[[nodiscard]] double microsecondsOf(Work&& work) {
  const auto begin = std::chrono::steady_clock::now();
  std::forward<Work>(work)();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
}

/// Times work(i) for every i below `count` in each of `rounds` rounds; before() is called before each and not
/// timed. The smallest time of all rounds counts for each i, since longer ones contain interference by other
/// programs.
template <typename Work, typename Before>
[[nodiscard]] Percentiles timed(std::size_t count, int rounds, Work&& work, Before&& before) {
  std::vector<double> smallest(count, std::numeric_limits<double>::infinity());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < count; ++i) {
      before();
      smallest[i] = std::min(smallest[i], microsecondsOf([&] { work(i); }));
    }
  }
  return percentilesOf(std::move(smallest));
}

template <typename Work>
[[nodiscard]] Percentiles timed(std::size_t count, int rounds, Work&& work) {
  return timed(count, rounds, std::forward<Work>(work), [] {});
}

/// Whether this thread had to give the processor away.
class Preemption {
 public:
  [[nodiscard]] bool sinceLastCall() {
    rusage usage{};
    getrusage(RUSAGE_THREAD, &usage);
    return std::exchange(switches_, usage.ru_nivcsw) != usage.ru_nivcsw;
  }

 private:
  long switches_ = 0;
};

/// Writes 100 MB to evict the processor caches.
class ColdCaches {
 public:
  void operator()() {
    for (std::size_t i = 0; i < filler_.size(); i += 8) filler_[i] = ++stamp_;
  }

 private:
  std::vector<std::uint64_t> filler_ = std::vector<std::uint64_t>(100'000'000 / sizeof(std::uint64_t));
  std::uint64_t stamp_ = 0;
};

}  // namespace tenon::bench
