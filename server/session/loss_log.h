#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace tenon::session {

/// What to log of ticks that are lost one after the other: the first at once, then once in kPeriod how many
/// were lost since, and how many in all.
///
/// Threads: one (wire). Real-time: no.
class LossLog {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kPeriod{1};

  /// `from`: from what they are missing, as in "in the journal".
  explicit LossLog(std::string_view from) : from_(from) {}

  /// What to log, if anything, when `lost` ticks are lost so far; `is_last`: also within the period.
  std::optional<std::string> update(std::uint64_t lost, Time now, bool is_last = false) {
    if (lost <= told_ || (told_ > 0 && !is_last && now - told_at_ < kPeriod)) return std::nullopt;
    told_at_ = now;
    const std::uint64_t before = std::exchange(told_, lost);
    const std::uint64_t since = lost - before;
    const std::string missing = fmt::format("{} {}tick{} missing {}", since, before > 0 ? "more " : "",
                                            since == 1 ? " is" : "s are", from_);
    return before > 0 ? fmt::format("{}, {} in all", missing, lost) : missing;
  }

 private:
  std::string_view from_;
  std::uint64_t told_ = 0;  ///< [ticks] lost, as was logged
  Time told_at_;
};

}  // namespace tenon::session
