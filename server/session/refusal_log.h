#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace tenon::session {

/// Which refusals are logged: each text when it is new, although inputs come at 1 kHz, and at a bounded rate,
/// whatever clients send. Those that are not logged for the rate are counted, and the count is logged.
///
/// A text is known for as long as it is among the last kKnown ones; then it is new again.
///
/// Threads: one (wire). Real-time: no.
class RefusalLog {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kKnown = 100;          ///< texts
  static constexpr std::size_t kAtOnce = 20;          ///< texts logged in kPeriod, at most
  static constexpr std::chrono::seconds kPeriod{10};  ///< also between counts

  /// What to log of this refusal, if anything.
  std::optional<std::string> add(const std::string& text, Time now) {
    if (const auto known = known_.find(text); known != known_.end()) {
      known->second = ++uses_;
      return std::nullopt;
    }
    if (now - begin_ >= kPeriod) begin_ = now, logged_ = 0;
    if (logged_ >= kAtOnce) {
      ++unsaid_;
      newest_ = text;
      return std::nullopt;
    }
    ++logged_;
    if (known_.size() >= kKnown)
      known_.erase(std::min_element(known_.begin(), known_.end(),
                                    [](const auto& a, const auto& b) { return a.second < b.second; }));
    known_[text] = ++uses_;
    return text;
  }
  /// One turn: how many were not logged in the period that has ended, if any.
  std::optional<std::string> step(Time now) {
    if (unsaid_ == 0 || now - begin_ < kPeriod) return std::nullopt;
    begin_ = now, logged_ = 0;
    return fmt::format("{} more refusals, the last one: {}", std::exchange(unsaid_, 0), newest_);
  }

 private:
  std::map<std::string, std::uint64_t> known_;  ///< and when each was used last, by uses_
  std::uint64_t uses_ = 0;
  Time begin_;              ///< of the period
  std::size_t logged_ = 0;  ///< in it
  std::uint64_t unsaid_ = 0;
  std::string newest_;  ///< of those
};

}  // namespace tenon::session
