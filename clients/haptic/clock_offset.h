#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// How far the server's monotonic clock is ahead of this machine's, from exchanges of ClockSync.
///
/// Of the exchanges of the last seconds the one with the shortest round trip decides (the filter of NTP, RFC
/// 5905, section 10): the offset that it yields is off by half of that round trip at most, however different
/// the two directions are, and by the drift of both clocks since then.
///
/// Threads: one. Real-time: everything.
class ClockOffset {
 public:
  /// An answer of the server that arrived at `now_ns` by the clock that set ClockSync::sent_ns. One whose
  /// stamps contradict each other is ignored.
  void add(const ClockSync& answer, std::int64_t now_ns) noexcept;

  [[nodiscard]] bool known() const noexcept { return count_ > 0; }
  /// [s] server's clock less this machine's; 0 while it is not known.
  [[nodiscard]] double offset() const noexcept;
  /// [s] what offset() is off at most, at `now_ns`; infinite while it is not known.
  [[nodiscard]] double error(std::int64_t now_ns) const noexcept;
  /// [s] shortest of the last kTrips exchanges, without the time that the answer took in the server; 0: none.
  [[nodiscard]] double roundTrip() const noexcept;

  /// [s] 90th percentile of the last round trips less the shortest; 0: none.
  [[nodiscard]] double tripJitter() const noexcept;

  static constexpr std::uint64_t kTrips = 20;  ///< [exchanges] 4 s of 5 a second
  static constexpr double kDrift = 100e-6;     ///< [s/s] of two quartz clocks against each other, at most

 private:
  struct Exchange {
    std::int64_t round_trip = std::numeric_limits<std::int64_t>::max();  // [ns]
    std::int64_t offset = 0;                                             // [ns]
    std::int64_t at = 0;                                                 // [ns]
  };
  [[nodiscard]] const Exchange& best() const noexcept;
  [[nodiscard]] std::int64_t shortestTrip(std::uint64_t count) const noexcept;

  static constexpr std::size_t kExchanges = 64;  // 13 s of 5 a second
  std::array<Exchange, kExchanges> exchanges_{};
  std::uint64_t count_ = 0;
};

}  // namespace tenon::haptic
