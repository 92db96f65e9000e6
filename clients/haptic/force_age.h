#pragma once

#include <array>
#include <cstdint>

#include "idl/types/messages.h"

namespace tenon {

/// Durations counted in bins of 50 us up to 100 ms, so that quantiles need no memory of each.
///
/// Threads: one. Real-time: everything.
class DurationHistogram {
 public:
  void add(std::int64_t nanoseconds) noexcept;
  /// [s] upper edge of the bin below which `share` of the durations lie; 0 when there is none.
  [[nodiscard]] double quantile(double share) const noexcept;
  [[nodiscard]] double longest() const noexcept { return static_cast<double>(longest_) * 1e-9; }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  static constexpr std::int64_t kBin = 50'000;  // [ns]
  static constexpr std::size_t kBins = 2000;
  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t longest_ = 0;
};

/// How long it takes from reading a hand to having the server's contacts for that reading: the age of what is
/// felt. And how late the loop runs that reads it.
///
/// Threads: one. Real-time: everything.
class ForceAge {
 public:
  /// A reading was taken; `period_ns` is what should lie between two.
  void sent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept;
  void answered(std::uint32_t seq, std::int64_t now_ns) noexcept;
  /// Fills what is measured here.
  void fill(Telemetry& telemetry) const noexcept;

 private:
  static constexpr std::size_t kRing = 1024;
  struct Sent {
    std::uint32_t seq = 0;
    std::int64_t at = 0;
  };
  std::array<Sent, kRing> sent_{};
  DurationHistogram ages_;
  DurationHistogram late_;
  std::uint32_t newest_ = 0;
  std::int64_t last_sent_ = 0;
};

}  // namespace tenon
