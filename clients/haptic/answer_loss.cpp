#include "clients/haptic/answer_loss.h"

#include <algorithm>

namespace tenon::haptic {

void AnswerLoss::received(HandId hand, std::uint32_t sent, std::int64_t now_ns) noexcept {
  auto found =
      std::find_if(hands_.begin(), hands_.end(), [&](const Answers& one) { return one.hand == hand; });
  const bool is_first = found == hands_.end();
  if (is_first) {
    if (hands_.full()) return;
    hands_.push_back({.hand = hand});
    found = hands_.end() - 1;
  }
  const auto step = static_cast<std::int32_t>(sent - found->newest);
  const bool is_interrupted = now_ns - found->heard_at > kInterruption || step < -kFarthest;
  found->heard_at = now_ns;
  if (is_first || is_interrupted) {
    found->newest = sent;
    return;
  }
  if (step == 0) return;  // repeated
  ++found->arrived;
  if (step < 0) return;
  found->due += static_cast<std::uint32_t>(step);
  found->newest = sent;
}

std::optional<double> AnswerLoss::take() noexcept {
  std::optional<double> largest;
  for (Answers& one : hands_) {
    // of a second before may have come in this one
    const std::uint32_t arrived = std::min(one.arrived, one.due);
    if (one.due >= 2) largest = std::max(largest.value_or(0.0), 1.0 - static_cast<double>(arrived) / one.due);
    one.due = one.arrived = 0;
  }
  return largest;
}

}  // namespace tenon::haptic
