#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace tenon::bench {

/// What a list of times says. Microseconds.
struct Percentiles {
  double median = 0.0;
  double p90 = 0.0;
  double p99 = 0.0;
  double most = 0.0;
};

[[nodiscard]] inline Percentiles percentilesOf(std::vector<double> microseconds) {
  if (microseconds.empty()) return {};
  std::sort(microseconds.begin(), microseconds.end());
  const auto at = [&microseconds](std::size_t percent) {
    return microseconds[percent * (microseconds.size() - 1) / 100];
  };
  return {at(50), at(90), at(99), microseconds.back()};
}

/// How long one call takes [us].
template <typename Work>
[[nodiscard]] double microsecondsOf(Work&& work) {
  const auto begin = std::chrono::steady_clock::now();
  std::forward<Work>(work)();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
}

/// `work(i)` for every i below `count`, `rounds` times over, each call timed; `before()` untimed ahead of
/// each. Of every i the least of its rounds counts: what other programs took is no property of ours.
template <typename Work, typename Before>
[[nodiscard]] Percentiles timed(std::size_t count, int rounds, Work&& work, Before&& before) {
  std::vector<double> least(count, std::numeric_limits<double>::infinity());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < count; ++i) {
      before();
      least[i] = std::min(least[i], microsecondsOf([&] { work(i); }));
    }
  }
  return percentilesOf(std::move(least));
}

template <typename Work>
[[nodiscard]] Percentiles timed(std::size_t count, int rounds, Work&& work) {
  return timed(count, rounds, std::forward<Work>(work), [] {});
}

/// Writes over 100 MB, so that what comes next finds cold caches.
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
