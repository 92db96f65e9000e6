#include "clients/haptic/link_clock.h"

#include <algorithm>

namespace tenon::haptic {

bool LinkClock::ask(ClientId client, std::int64_t now_ns, ClockSync& request) noexcept {
  if (asked_ != 0 && now_ns - asked_ < (requests_ < kFirst ? kFirstInterval : kInterval)) return false;
  asked_ = now_ns;
  ++requests_;
  request = {};
  request.client = client;
  request.sent_ns = now_ns;
  return true;
}

void LinkClock::sent(std::uint32_t seq, std::uint32_t inputs) noexcept {
  inputs_ += inputs;
  sent_[seq % kRing] = {seq, inputs_};
}

void LinkClock::receive(const ClockSync& answer, std::int64_t now_ns) noexcept {
  offset_.add(answer, now_ns);
  input_gap_ = answer.longest_gap;
  const Sent& newest = sent_[answer.newest_seq % kRing];
  if (answer.newest_seq == 0 || newest.seq != answer.newest_seq) return;
  const bool is_another =
      since_ && (newest.seq < since_->seq || answer.inputs_received < answer_since_.inputs_received);
  // the first answer, one of another server or seat, or as long as it tells of an interruption
  if (!since_ || is_another || answer.longest_gap > kInterruption) {
    since_ = newest;
    answer_since_ = answer;
    return;
  }
  const std::uint32_t sent = newest.inputs - since_->inputs;
  if (sent < (loss_known_ ? kInputs : kFirstInputs)) return;
  const auto share = [sent](std::uint32_t now, std::uint32_t before) {
    return std::min(1.0, static_cast<double>(now - before) / sent);
  };
  loss_known_ = true;
  inputs_lost_ = 1.0 - share(answer.inputs_received, answer_since_.inputs_received);
  inputs_replaced_ = share(answer.inputs_replaced, answer_since_.inputs_replaced);
  ticks_without_input_ = share(answer.ticks_without_input, answer_since_.ticks_without_input);
  since_ = newest;
  answer_since_ = answer;
}

void LinkClock::fill(Telemetry& telemetry, std::int64_t now_ns) const noexcept {
  telemetry.clock_known = offset_.known();
  telemetry.clock_offset = offset_.known() ? offset_.offset() : 0.0;
  telemetry.clock_error = offset_.known() ? offset_.error(now_ns) : 0.0;
  telemetry.round_trip = offset_.roundTrip();
  telemetry.trip_jitter = offset_.tripJitter();
  telemetry.inputs_lost = inputs_lost_;
  telemetry.inputs_replaced = inputs_replaced_;
  telemetry.ticks_without_input = ticks_without_input_;
  telemetry.input_gap = input_gap_;
}

}  // namespace tenon::haptic
