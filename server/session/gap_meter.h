#pragma once

#include <algorithm>
#include <cstdint>

namespace tenon::session {

/// Longest time between two messages of a client, of the last one to two seconds, by the server's clock: what
/// delay, jitter, loss and busy machines together make of its link.
///
/// Threads: one. Real-time: everything.
class GapMeter {
 public:
  void received(std::int64_t now_ns) noexcept {
    if (last_ != 0) current_ = std::max(current_, now_ns - last_);
    last_ = now_ns;
    turn(now_ns);
  }
  /// [s] with the silence that lasts now; 0 before the second message.
  [[nodiscard]] double longest(std::int64_t now_ns) const noexcept {
    if (last_ == 0) return 0.0;
    return static_cast<double>(std::max({current_, before_, now_ns - last_})) * 1e-9;
  }

 private:
  static constexpr std::int64_t kPeriod = 1'000'000'000;  // [ns]

  void turn(std::int64_t now_ns) noexcept {
    if (now_ns - turned_ < kPeriod) return;
    before_ = current_;
    current_ = 0;
    turned_ = now_ns;
  }

  std::int64_t last_ = 0, turned_ = 0;     // [ns]
  std::int64_t current_ = 0, before_ = 0;  // [ns] longest of this period and of the one before
};

}  // namespace tenon::session
