#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// Histogram of durations: bins of 50 us up to 100 ms, then of 2 % up to 10 s; longer ones are counted in the
/// last bin.
///
/// Threads: one. Real-time: everything.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void add(std::int64_t nanoseconds) noexcept;
  void clear() noexcept { *this = {}; }
  /// [s] upper edge of the bin that contains the quantile `fraction` [-], and max() at most; 0 when the
  /// histogram is empty.
  [[nodiscard]] double quantile(double fraction) const noexcept;
  /// [s] exact maximum; 0 when the histogram is empty.
  [[nodiscard]] double max() const noexcept { return static_cast<double>(max_) * 1e-9; }
  /// [s] exact minimum; 0 when the histogram is empty.
  [[nodiscard]] double min() const noexcept { return count_ > 0 ? static_cast<double>(min_) * 1e-9 : 0.0; }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  static constexpr std::int64_t kBin = 50'000;  // [ns]
  static constexpr std::size_t kFineBins = 2000;
  static constexpr double kGrowth = 1.02;          // [-] of a coarse bin to the next
  static constexpr std::size_t kCoarseBins = 233;  // ln 100 / ln 1.02: 100 ms to 10 s
  std::array<std::uint64_t, kFineBins + kCoarseBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t max_ = 0;                                         // [ns]
  std::int64_t min_ = std::numeric_limits<std::int64_t>::max();  // [ns]
};

/// Share of a hand's answers that a newer one replaced before a cycle of the station used them: it came in
/// the same cycle, or before them.
///
/// Threads: one. Real-time: everything.
class ReplacedAnswers {
 public:
  /// The answer of a tick of the server's life `epoch`, in the cycle that began at `now_ns`. Another life
  /// begins anew.
  void received(HandId hand, std::uint32_t epoch, Tick tick, std::int64_t now_ns) noexcept;
  /// [-] since the last call, of the hand with the largest; 0 without answers.
  [[nodiscard]] double take() noexcept;

 private:
  struct Answers {
    HandId hand;
    std::uint32_t epoch = 0;
    Tick newest = 0;
    std::int64_t cycle = 0;  ///< [ns] of the newest
    std::uint32_t received = 0, replaced = 0;
  };
  FixedVector<Answers, 8> hands_;
};

/// Latency statistics of a station: time from a device reading to the server's contacts computed from it (age
/// of the rendered force), its jitter, the longest time between two such answers, answers that were replaced,
/// and lateness of the servo loop.
///
/// Threads: one. Real-time: everything.
class ForceAgeStatistics {
 public:
  /// Input `seq` was read at `now_ns`; `period_ns` is the nominal period of the loop.
  void inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept;
  /// A manifold arrived. An answer that is repeated, overtaken or to an unknown input has no age.
  void answerReceived(const HandManifold& manifold, std::int64_t now_ns) noexcept;
  /// Sets the fields of `telemetry` that are measured here, and begins a new period of those that it states
  /// of the time since the last one.
  void fill(Telemetry& telemetry) noexcept;

 private:
  static constexpr std::size_t kRing = 16384;  // ages of up to 16 s are known
  struct Sent {
    std::uint32_t seq = 0;
    std::int64_t time = 0;  // [ns]
  };
  std::array<Sent, kRing> sent_{};
  DurationHistogram ages_;
  DurationHistogram recent_ages_;  // since the last fill()
  DurationHistogram lateness_;
  ReplacedAnswers replaced_;  // since the last fill()
  std::uint32_t server_epoch_ = 0;
  std::uint32_t newest_answer_ = 0;
  std::optional<std::int64_t> answered_at_;  // [ns] of newest_answer_
  std::int64_t longest_gap_ = 0;             // [ns] between two answers
  std::optional<std::int64_t> last_sent_;    // [ns]
};

}  // namespace tenon::haptic
