#include "clients/haptic/force_age_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tenon::haptic {

void DurationHistogram::add(std::int64_t nanoseconds) noexcept {
  const std::int64_t duration = std::max<std::int64_t>(0, nanoseconds);
  auto bin = static_cast<std::size_t>(duration / kBin);
  if (bin >= kFineBins) {
    const double times = static_cast<double>(duration) / static_cast<double>(kBin * kFineBins);
    bin =
        kFineBins + std::min(kCoarseBins - 1, static_cast<std::size_t>(std::log(times) / std::log(kGrowth)));
  }
  ++bins_[bin];
  ++count_;
  max_ = std::max(max_, duration);
  min_ = std::min(min_, duration);
}

double DurationHistogram::quantile(double fraction) const noexcept {
  const auto rank = static_cast<std::uint64_t>(fraction * static_cast<double>(count_));
  std::uint64_t passed = 0;
  for (std::size_t bin = 0; bin + 1 < bins_.size(); ++bin) {
    passed += bins_[bin];
    if (passed <= rank) continue;
    const double fine = static_cast<double>(std::min(bin + 1, kFineBins)) * static_cast<double>(kBin) * 1e-9;
    const double edge =
        bin < kFineBins ? fine : fine * std::pow(kGrowth, static_cast<double>(bin + 1 - kFineBins));
    return std::min(edge, max());
  }
  return count_ > 0 ? max() : 0.0;
}

void ReplacedAnswers::received(HandId hand, std::uint32_t epoch, Tick tick, std::int64_t now_ns) noexcept {
  auto found =
      std::find_if(hands_.begin(), hands_.end(), [&](const Answers& one) { return one.hand == hand; });
  if (found == hands_.end()) {
    if (hands_.full()) return;
    hands_.push_back({.hand = hand, .epoch = epoch, .newest = tick, .cycle = now_ns, .received = 1});
    return;
  }
  if (epoch != found->epoch) {
    found->epoch = epoch;
    found->newest = 0;
  }
  if (tick == found->newest) return;  // repeated
  ++found->received;
  if (tick < found->newest || now_ns == found->cycle) ++found->replaced;
  if (tick < found->newest) return;
  found->newest = tick;
  found->cycle = now_ns;
}

double ReplacedAnswers::take() noexcept {
  double largest = 0.0;
  for (Answers& one : hands_) {
    if (one.received > 0) largest = std::max(largest, static_cast<double>(one.replaced) / one.received);
    one.received = one.replaced = 0;
  }
  return largest;
}

void ForceAgeStatistics::inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept {
  sent_[seq % kRing] = {seq, now_ns};
  if (last_sent_) lateness_.add(now_ns - *last_sent_ - period_ns);
  last_sent_ = now_ns;
}

void ForceAgeStatistics::answerReceived(const HandManifold& manifold, std::int64_t now_ns) noexcept {
  replaced_.received(manifold.hand, manifold.server_epoch, manifold.tick, now_ns);
  const std::uint32_t seq = manifold.answers_seq;
  if (std::exchange(server_epoch_, manifold.server_epoch) != manifold.server_epoch) {
    // another life of the server numbers ticks, and so inputs, anew
    newest_answer_ = 0;
    answered_at_.reset();
  }
  // the manifolds of all hands answer the same input: only the first counts
  if (seq == 0 || seq <= newest_answer_) return;
  const Sent& sent = sent_[seq % kRing];
  if (sent.seq != seq) return;
  newest_answer_ = seq;
  if (answered_at_) longest_gap_ = std::max(longest_gap_, now_ns - *answered_at_);
  answered_at_ = now_ns;
  ages_.add(now_ns - sent.time);
  recent_ages_.add(now_ns - sent.time);
}

void ForceAgeStatistics::fill(Telemetry& telemetry) noexcept {
  telemetry.samples = ages_.count();
  telemetry.input_to_force_p50 = ages_.quantile(0.5);
  telemetry.input_to_force_p99 = ages_.quantile(0.99);
  telemetry.input_to_force_max = ages_.max();
  telemetry.loop_late_p99 = lateness_.quantile(0.99);
  telemetry.age = recent_ages_.quantile(0.5);
  telemetry.jitter = std::max(0.0, recent_ages_.quantile(0.99) - recent_ages_.min());
  telemetry.answers_replaced = replaced_.take();
  recent_ages_.clear();
  telemetry.longest_silence = static_cast<double>(longest_gap_) * 1e-9;
}

}  // namespace tenon::haptic
