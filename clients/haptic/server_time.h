#pragma once

#include <array>
#include <cstdint>

#include "idl/types/ids.h"

namespace tenon::haptic {

/// Which tick of the server belongs to an input of this station: the one that would use it if there were no
/// delay. Half of a round trip is taken for the way there; of all answers of the last seconds the one with
/// the shortest round trip counts, so that jitter and repeats do not shift it.
///
/// Threads: one. Real-time: everything.
class ServerTime {
 public:
  /// Tick `tick` used input `answered` (0: none yet), which the server had kept back for `playout` [ticks],
  /// and its answer is there when input `seq` is read.
  void receive(Tick tick, std::uint32_t answered, std::uint32_t seq, std::uint32_t playout) noexcept {
    if (answered == 0) return;
    answered += playout;
    const auto trip = static_cast<std::int32_t>(seq - answered);
    if (trip < 1 || trip > kLongestTrip) return;
    if (seq - window_began_ > kWindow) {
      best_ = {Answer{}, best_[0]};
      window_began_ = seq;
    }
    // an answer without delay is of the last tick
    const double there = 0.5 * (trip - 1);
    if (trip <= best_[0].trip)
      best_[0] = {trip, static_cast<double>(tick) - static_cast<double>(answered) - there};
  }
  [[nodiscard]] bool known() const noexcept { return shortest().trip <= kLongestTrip; }
  /// [ticks] of input `seq`; a half counts where the ways differ by a tick. Precondition: known().
  [[nodiscard]] double tickOf(std::uint32_t seq) const noexcept {
    return static_cast<double>(seq) + shortest().offset;
  }

 private:
  static constexpr std::int32_t kLongestTrip = 1000;  // [ticks]
  static constexpr std::uint32_t kWindow = 2000;      // [ticks] each of two
  struct Answer {
    std::int32_t trip = kLongestTrip + 1;  // [ticks]
    double offset = 0.0;                   // [ticks]
  };
  [[nodiscard]] const Answer& shortest() const noexcept {
    return best_[1].trip < best_[0].trip ? best_[1] : best_[0];
  }
  std::array<Answer, 2> best_;  // of this window and of the last one
  std::uint32_t window_began_ = 0;
};

}  // namespace tenon::haptic
