#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "idl/types/fixed_vector.h"
#include "idl/types/messages/hands.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Decides which reading of a hand a tick takes, of those that have come over a link.
///
/// Threads: one (tick). Real-time: everything.
class ReadingPlayout {
 public:
  /// A reading that has come; of those up to `seq` that have waited before, nothing is added again.
  void add(const HandReading& reading) noexcept;
  /// Forgets all.
  void clear() noexcept;
  /// `newest` is taken, whatever waits.
  const HandReading* take(const HandReading& newest) noexcept;

  /// The reading `playout` [ticks] before the newest one. Without one that is new, the next of those that
  /// wait; a newer one that waits alone is not kept back, so the delay begins with the first input that is
  /// lost. Null: none.
  const HandReading* takeBehind(std::uint32_t playout) noexcept;

  /// Of a hand that sends a sample each `period` [ticks]: the reading of one tick after that of the last
  /// call, on the straight line between two samples; null: none. A sample that is late holds the hand at the
  /// newest one, and the backlog, by which the hand is behind, grows by as much: so a link's jitter becomes a
  /// delay. The backlog decides how much of it is played each tick:
  /// - up to 3 periods: 1 tick (with a period of 1: up to 1);
  /// - more than 3: 9/8 ticks;
  /// - more than 8: 2 ticks;
  /// - after a freeze (`was_frozen`), or beyond the larger of 8 periods and the longest freeze: jump to one
  ///   period.
  const HandReading* takeBetween(std::uint32_t period, bool was_frozen = false) noexcept;
  /// [ticks] from the reading that was taken last to the newest that has come.
  [[nodiscard]] std::uint32_t behind() const noexcept;
  /// Largest backlog [ticks] within the last 1 to 2 s: of behind() after takeBetween().
  [[nodiscard]] std::uint32_t mostBehind() const noexcept {
    return std::max(most_behind_[0], most_behind_[1]);
  }

  /// Readings that were never taken since a newer one was, since the start.
  [[nodiscard]] std::uint32_t replaced() const noexcept { return replaced_; }

  static constexpr std::uint32_t kMostPeriodsBehind = 8;
  static constexpr std::uint32_t kUsualPeriodsBehind = 3;  ///< what is farther behind is worked off
  static constexpr std::uint32_t kWindow = 1000;           ///< [ticks]

 private:
  /// From kMostFreezeTicks behind on, half of those ticks come while the others are taken two at a time.
  static constexpr std::size_t kWaiting = kMostFreezeTicks / 2 + kMostPeriodsBehind;

  const HandReading* advance(std::uint32_t period, bool was_frozen) noexcept;
  void dropFirst(std::size_t count) noexcept;
  /// Of sequence numbers, which begin again at 0 after the largest.
  static bool isBefore(std::uint32_t a, std::uint32_t b) noexcept {
    return static_cast<std::int32_t>(a - b) < 0;
  }

  FixedVector<HandReading, kWaiting> waiting_;  // by seq, ascending
  HandReading taken_;                           // the last one
  std::optional<std::uint32_t> heard_;          // seq of the newest one that has waited
  std::optional<HandReading> from_;             // the sample at or before taken_
  std::uint32_t replaced_ = 0;
  std::array<std::uint32_t, 2> most_behind_{};  // [ticks] in this window and in the last one
  std::uint32_t in_window_ = 0;                 // [ticks]
};

/// The reading of input `seq`, between those of two inputs: position, orientation and velocity on the
/// straight line, buttons of the earlier one, active if both are.
[[nodiscard]] HandReading between(const HandReading& from, const HandReading& to, std::uint32_t seq) noexcept;

}  // namespace tenon::session
