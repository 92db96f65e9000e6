#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/force_model.h"
#include "idl/types/messages/hands.h"

namespace tenon::haptic {

/// How often a station sends and hears, chosen by its link once a second.
///
/// On a long link a hand's pose comes late anyway, so that a fifth of the samples, with the ticks between
/// them filled by the server, costs a few milliseconds more and saves four fifths of the bytes. A station
/// that renders its own copy of the scene needs the server's answers to correct it, not to feel them.
///
/// Threads: one. Real-time: everything.
class RateChooser {
 public:
  static constexpr double kFar = 0.020;   ///< [s] round trip from which on inputs are sparse
  static constexpr double kNear = 0.015;  ///< [s] below which they are no more
  static constexpr std::uint32_t kFarPeriods = 5;
  static constexpr double kSlowAnswers = 0.020;  ///< [s] between two manifolds then

  /// `round_trip` [s]; none: not known. `known_loss` [-] of messages; none: not known yet, and a tenth is
  /// assumed. `jitter` [s] of the answers' age.
  void step(std::optional<double> round_trip, ForceModelKind kind, std::optional<double> known_loss,
            double jitter) noexcept {
    const double loss = known_loss.value_or(kAssumedLoss);
    if (round_trip > kFar) is_far_ = true;
    if (round_trip && *round_trip < kNear) is_far_ = false;
    allowance_ = kSlowAnswers * (1.0 + lostInARow(loss));
    // what is lost in a row must not look like a gap, which takes the force away (AnswerAge)
    const bool is_safe =
        jitter + allowance_ <= std::max(round_trip.value_or(0.0), AnswerAge::kLongestJitter) + kSlowAnswers;
    slow_answers_ = is_safe && (is_far_ || kind == ForceModelKind::kSceneCopy);
  }
  /// Inputs and states are sparse.
  [[nodiscard]] bool isFar() const noexcept { return is_far_; }
  /// Frames come at 100 Hz and manifolds at 50 Hz instead of 1 kHz.
  [[nodiscard]] bool slowAnswers() const noexcept { return slow_answers_; }
  /// [s] by which an answer may be older because they come at that rate, for AnswerAge::setJitter.
  [[nodiscard]] double allowance() const noexcept { return slow_answers_ ? allowance_ : 0.0; }
  /// DeviceInput::period of a hand for which the station proposes `proposed` [ticks].
  [[nodiscard]] std::uint8_t inputPeriod(std::uint8_t proposed) const noexcept {
    const std::uint32_t period = is_far_ ? proposed * kFarPeriods : proposed;
    return static_cast<std::uint8_t>(std::min<std::uint32_t>(period, kMostInputPeriod));
  }
  /// [ticks] between two HandStates.
  [[nodiscard]] std::uint32_t statePeriod() const noexcept { return is_far_ ? 40 : 10; }

 private:
  static constexpr double kRare = 1e-3;        ///< [-] share of answers that begin such a row
  static constexpr double kAssumedLoss = 0.1;  ///< [-]

  /// `loss` [-].
  static double lostInARow(double loss) noexcept {
    return loss > 0.0 ? std::ceil(std::log(kRare) / std::log(std::min(loss, 0.9))) : 0.0;
  }

  bool is_far_ = false;
  double allowance_ = 0.0;  ///< [s]
  bool slow_answers_ = false;
};

}  // namespace tenon::haptic
