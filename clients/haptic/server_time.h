#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "idl/types/ids.h"
#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

/// Estimates server tick - input seq: the fastest answer within two 5 s windows, plus half the round trip.
/// The input that an answer names tells nothing here: the server keeps inputs back, and fills ticks between
/// sparse ones. After a delay increase, old samples are corrected; after a decrease the error lasts until the
/// next round-trip measurement (about 1 s). Asymmetry error: half the difference. Clocks that drift apart by
/// 1e-4 are off by 1 tick at most. Another epoch of the server begins anew.
///
/// Threads: one. Real-time: everything.
class ServerTime {
 public:
  /// `round_trip` [s]: shortest of the link, as ClockSync measures it; 0: not known, or none.
  void setRoundTrip(double round_trip) noexcept {
    const double before = one_way_ticks_;
    one_way_ticks_ =
        std::isfinite(round_trip) ? 0.5 * std::clamp(round_trip, 0.0, kLongestTrip) / kTickSeconds : 0.0;
    if (before > 0.0 && one_way_ticks_ > before)
      for (double& ahead : ahead_) ahead = std::max(kUnknown, ahead - (one_way_ticks_ - before));
  }
  /// `heard` is the newest answer when input `seq` is read.
  void receive(const HandManifold& heard, std::uint32_t seq) noexcept {
    if (heard.server_epoch != heard_epoch_) ahead_ = {kUnknown, kUnknown};
    if (heard.server_epoch == heard_epoch_ && heard.tick == heard_tick_) return;
    heard_epoch_ = heard.server_epoch;
    heard_tick_ = heard.tick;
    if (heard.answers_seq == 0) return;
    if (seq - window_began_ > kWindow) {
      ahead_ = {kUnknown, ahead_[0]};
      window_began_ = seq;
    }
    ahead_[0] = std::max(ahead_[0], static_cast<double>(heard.tick) - static_cast<double>(seq));
  }
  [[nodiscard]] bool known() const noexcept { return most() > kUnknown; }
  /// [ticks] of input `seq`; a half counts where the ways differ by a tick. Precondition: known().
  [[nodiscard]] double tickOf(std::uint32_t seq) const noexcept {
    // an answer without delay is of the last tick
    return static_cast<double>(seq) + most() + 1.0 + one_way_ticks_;
  }

 private:
  static constexpr double kLongestTrip = 1.0;  // [s]
  // [ticks] each of two: longer than ClockOffset keeps round trips, and a second until one is told
  static constexpr std::uint32_t kWindow = 5000;
  static constexpr double kUnknown = std::numeric_limits<double>::lowest();  // [ticks]
  [[nodiscard]] double most() const noexcept { return std::max(ahead_[0], ahead_[1]); }

  std::array<double, 2> ahead_{kUnknown, kUnknown};  // [ticks] answer less input, of this window and the last
  std::uint32_t window_began_ = 0;
  Tick heard_tick_ = 0;
  std::uint32_t heard_epoch_ = 0;
  double one_way_ticks_ = 0.0;  // [ticks] of the way to the server
};

}  // namespace tenon::haptic
