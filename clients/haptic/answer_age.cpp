#include "clients/haptic/answer_age.h"

#include <algorithm>

namespace tenon::haptic {

void AnswerAge::step(std::uint32_t seq, std::uint32_t answered, double dt) noexcept {
  now_ += dt;
  reads_[seq % kRing] = {seq, now_};
  if (now_ - window_began_ > kWindow &&
      delays_[0] < kNever) {  // without answers the delay of the link stays known
    delays_ = {kNever, delays_[0]};
    window_began_ = now_;
  }
  if (answered == answered_) return;
  answered_ = answered;
  const double since_last = std::min(now_ - answer_came_at_, kLongestPause);
  answer_came_at_ = now_;
  const Read& read = reads_[answered % kRing];
  answered_read_at_ = read.seq == answered ? read.at : -kNever;
  delays_[0] = std::min(delays_[0], age());
  too_long_for_ = delay() > (isTooLong() ? kShortAgain : kTooLong) ? too_long_for_ + since_last : 0.0;
}

double AnswerAge::excess() const noexcept {
  const double delay = std::min({delays_[0], delays_[1], kLongestDelay});
  return std::max(0.0, age() - delay - std::max(delay, jitter_));
}

}  // namespace tenon::haptic
