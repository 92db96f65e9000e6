#pragma once

#include <cstdint>
#include <optional>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"

namespace tenon::haptic {

/// Share of the answers on one topic that are lost on the way, by their number (HandManifold::sent).
///
/// What the server did not send, because a newer one was ready, has no number, and one that comes after a
/// newer one has arrived; what DDS itself discards because it comes out of order counts as lost. A silence of
/// more than kInterruption, or another server, begins anew: what did not arrive meanwhile is no loss of the
/// link.
///
/// Threads: one. Real-time: everything.
class AnswerLoss {
 public:
  static constexpr std::int64_t kInterruption = 300'000'000;  ///< [ns]

  /// Answer number `sent` of a hand has come, at `now_ns`.
  void received(HandId hand, std::uint32_t sent, std::int64_t now_ns) noexcept;
  /// [-] since the last call, of the hand that lost most; none: fewer than two were due.
  [[nodiscard]] std::optional<double> take() noexcept;

 private:
  static constexpr std::size_t kHands = 8;
  static constexpr std::int32_t kFarthest = 1000;  ///< an answer that is so many behind is another server's
  struct Answers {
    HandId hand;
    std::uint32_t newest = 0;
    std::int64_t heard_at = 0;           ///< [ns]
    std::uint32_t due = 0, arrived = 0;  ///< since take()
  };
  FixedVector<Answers, kHands> hands_;
};

}  // namespace tenon::haptic
