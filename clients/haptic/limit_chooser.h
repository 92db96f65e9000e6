#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "idl/types/messages/hands.h"

namespace tenon::haptic {

/// What a station has measured of its link in the last second or so.
struct LinkMeasurement {
  double input_gap = 0.0;    ///< [s] longest time between two of its inputs at the server
  double trip_jitter = 0.0;  ///< [s] of the round trip: 90th percentile less the shortest
  double age_jitter = 0.0;   ///< [s] of the contacts: 99th percentile less the youngest
  double inputs_lost = 0.0;  ///< [-]
  /// [-] where answers are slow; none, not known, at 1 kHz, where DDS discards those that a newer one has
  /// overtaken, and where fewer than two were due
  std::optional<double> answers_lost;
  std::uint32_t input_period = 1;  ///< [ticks] DeviceInput::period
};

/// What follows from the link for a station and its hands.
struct LinkChoice {
  HandLimits limits;
  /// [-] of inputs or of answers, whichever is more, in seconds without an interruption
  double loss = 0.0;
  /// [s] age of contacts beyond the link's delay that is usual there
  double jitter = 0.0;
  /// [ticks] for which the server keeps an input back, so that one that is lost comes with the next one; so
  /// many earlier samples each input carries
  std::uint32_t playout_ticks = 0;

  bool operator==(const LinkChoice&) const = default;
};

/// Chooses the limits of a station's hands from what its link does, once a second.
///
/// A silence is a gap of the link if it is at most twice as long as the longest one that was measured or that
/// loss and jitter let expect; 20 ms more are for the machines. It is never below the limits of a link
/// without faults, and never above kMostFreezeTicks. A limit grows at once, and shrinks when a lower one
/// would have sufficed for kMemory. A silence of more than 0.3 s is a partition, and changes no limit.
///
/// Threads: one. Real-time: everything.
class LimitChooser {
 public:
  static constexpr std::size_t kMemory = 10;        ///< [measurements]
  static constexpr std::uint32_t kMostPlayout = 2;  ///< [ticks]
  static constexpr double kAllowedLoss = 1e-4;      ///< [-] of ticks without an input

  /// NaN counts as no fault.
  [[nodiscard]] LinkChoice step(const LinkMeasurement& now) noexcept;
  /// The server or the seat was gone for a while, which is no fault of the link: what the next kInterrupted
  /// measurements say, which contain that while, does not count.
  void interrupted() noexcept { ignored_ = kInterrupted; }

 private:
  static constexpr unsigned kInterrupted = 2;  ///< [measurements] one may have been made before its end
  /// `lost` [-] of the answers; none: not known.
  void averageAnswers(std::optional<double> lost) noexcept;

  std::array<LinkMeasurement, kMemory> last_{};
  double answers_lost_ = 0.0;  // [-] in the mean: a second has few slow answers
  unsigned above_most_ = 0;    // [measurements] in a row that lost more of them than a link does
  std::size_t count_ = 0;
  unsigned ignored_ = 0;  ///< [measurements] to come
};

}  // namespace tenon::haptic
