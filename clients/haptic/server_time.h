#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "idl/types/ids.h"
#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

/// Which tick of the server belongs to an input of this station: the one that would use it if there were no
/// delay. The answer of the last seconds that took least time, so that jitter and repeats do not shift it,
/// was half of the round trip on its way. The input that it answers tells nothing: the server keeps inputs
/// back, and fills ticks between sparse ones. Another epoch of the server begins anew.
///
/// Answers and round trips are measured at different times. A link that becomes longer by a way is noticed in
/// answers first, which the fastest one outlasts until the round trip is known: then the server's ticks have
/// not changed, and the answers before count as if they had taken the longer way. One that becomes shorter
/// makes the tick too late by as much until the next round trip is told, about a second. Ways that differ in
/// length are halved: an error of half their difference. Clocks that drift apart by 1e-4 are off by 1 tick at
/// most.
///
/// Threads: one. Real-time: everything.
class ServerTime {
 public:
  /// `round_trip` [s]: shortest of the link, as ClockSync measures it; 0: not known, or none.
  void setRoundTrip(double round_trip) noexcept {
    const double before = there_;
    there_ = std::isfinite(round_trip) ? 0.5 * std::clamp(round_trip, 0.0, kLongestTrip) / kTickSeconds : 0.0;
    if (before > 0.0 && there_ > before)
      for (double& ahead : ahead_) ahead = std::max(kUnknown, ahead - (there_ - before));
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
    return static_cast<double>(seq) + most() + 1.0 + there_;
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
  double there_ = 0.0;  // [ticks] of the way to the server
};

}  // namespace tenon::haptic
