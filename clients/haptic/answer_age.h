#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// Age of the server's answers on the station's own clock: time since the station read the input from which
/// the newest answer was computed. A source that needs the server is as old as that, however late or often
/// its messages arrive.
///
/// Threads: one. Real-time: everything.
class AnswerAge {
 public:
  /// One cycle, `dt` [s] after the last one: input `seq` is read now. `answered` is the input that the newest
  /// answer names; one that this station has not read within the last kRing cycles has no known age.
  void step(std::uint32_t seq, std::uint32_t answered, double dt) noexcept;

  /// [s] infinite before the first answer.
  [[nodiscard]] double age() const noexcept { return now_ - answered_read_at_; }
  /// [s] age minus link delay minus max(delay, jitter); >= 0. The delay is the smallest age of an answer in
  /// the last seconds with answers, at most kLongestDelay.
  [[nodiscard]] double excess() const noexcept;
  /// `jitter` [s] of the age that was measured lately, 0 at first.
  void setJitter(double jitter) noexcept {
    jitter_ = jitter > 0.0 ? std::min(jitter, kLongestJitter) : 0.0;  // the order of comparisons: NaN is none
  }
  [[nodiscard]] std::uint32_t answered() const noexcept { return answered_; }
  /// [s] of the link and back, as excess() has it but without a bound; infinite before the first answer.
  [[nodiscard]] double delay() const noexcept { return std::min(delays_[0], delays_[1]); }
  /// For a second at least each answer has been too old for contacts: the link's delay is above
  /// kLongestContactDelay one way. Ends with the first answer that is not.
  [[nodiscard]] bool isTooLong() const noexcept { return too_long_for_ >= kSure; }

  static constexpr double kLongestDelay =
      kLongestContactDelay;                       ///< [s] a longer one is no link to render contacts by
  static constexpr double kLongestJitter = 0.05;  ///< [s] a longer one is a gap

 private:
  static constexpr std::size_t kRing = 4096;
  static constexpr double kWindow =
      2.0;  ///< [s] each of two, with answers, in which the delay of the link is the smallest age
  static constexpr double kTooLong = 2.0 * kLongestDelay + 0.02;  ///< [s] round trip, 20 ms of it at the ends
  static constexpr double kShortAgain = kTooLong - 0.01;          ///< [s] likewise
  static constexpr double kSure = 1.0;  ///< [s] a late answer after an interruption is no delay of the link
  static constexpr double kLongestPause = 0.1;  ///< [s] between two answers that count towards it
  static constexpr double kNever = std::numeric_limits<double>::infinity();  ///< [s]
  struct Read {
    std::uint32_t seq = 0;
    double at = -kNever;  ///< [s]
  };
  std::array<Read, kRing> reads_{};    ///< by seq modulo its size
  double now_ = 0.0;                   ///< [s] sum of dt
  double answered_read_at_ = -kNever;  ///< [s]
  double jitter_ = 0.0;                ///< [s]
  double answer_came_at_ = -kNever;    ///< [s]
  double too_long_for_ = 0.0;          ///< [s] with answers
  std::uint32_t answered_ = 0;
  double window_began_ = 0.0;                     ///< [s]
  std::array<double, 2> delays_{kNever, kNever};  ///< [s] of this window and of the last one
};

}  // namespace tenon::haptic
