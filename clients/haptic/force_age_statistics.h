#pragma once

#include <array>
#include <cstdint>

#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// Histogram of durations with bins of 50 us up to 100 ms; longer ones are counted in the last bin.
///
/// Threads: one. Real-time: everything.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void add(std::int64_t nanoseconds) noexcept;
  /// [s] upper edge of the bin that contains the quantile `fraction` [-]; 0 when the histogram is empty.
  [[nodiscard]] double quantile(double fraction) const noexcept;
  /// [s] exact maximum; 0 when the histogram is empty.
  [[nodiscard]] double max() const noexcept { return static_cast<double>(max_) * 1e-9; }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  static constexpr std::int64_t kBin = 50'000;  // [ns]
  static constexpr std::size_t kBins = 2000;
  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t max_ = 0;  // [ns]
};

/// Latency statistics of a station: time from a device reading to the server's contacts computed from it (age
/// of the rendered force), and lateness of the servo loop.
///
/// Threads: one. Real-time: everything.
class ForceAgeStatistics {
 public:
  /// Input `seq` was read at `now_ns`; `period_ns` is the nominal period of the loop.
  void inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept;
  /// A manifold that answers input `seq` arrived. Repeated, overtaken and unknown answers are ignored.
  void answerReceived(std::uint32_t seq, std::int64_t now_ns) noexcept;
  /// Sets the fields of `telemetry` that are measured here.
  void fill(Telemetry& telemetry) const noexcept;

 private:
  static constexpr std::size_t kRing = 1024;
  struct Sent {
    std::uint32_t seq = 0;
    std::int64_t time = 0;  // [ns]
  };
  std::array<Sent, kRing> sent_{};
  DurationHistogram ages_;
  DurationHistogram lateness_;
  std::uint32_t newest_answer_ = 0;
  std::int64_t last_sent_ = 0;  // [ns]
};

}  // namespace tenon::haptic
