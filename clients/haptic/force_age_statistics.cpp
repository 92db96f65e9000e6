#include "clients/haptic/force_age_statistics.h"

#include <algorithm>
#include <cmath>

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

void AnswerLoss::ReceivedTicks::add(Tick tick) noexcept {
  if (count == 0) {
    first = last = tick;
  } else {
    if (tick <= last) return;  // repeated or overtaken
    period = std::min(period.value_or(tick - last), tick - last);
    last = tick;
  }
  ++count;
}

double AnswerLoss::ReceivedTicks::lostShare() const noexcept {
  if (!period) return 0.0;
  const auto sent = static_cast<double>((last - first) / *period + 1);
  return std::max(0.0, 1.0 - static_cast<double>(count) / sent);
}

void AnswerLoss::received(HandId hand, Tick tick) noexcept {
  const auto found = std::find_if(hands_.begin(), hands_.end(), [&](const Answers& answers) {
    return answers.all.count == 0 || answers.hand == hand;
  });
  if (found == hands_.end()) return;
  found->hand = hand;
  found->all.add(tick);
  if (tick % kSlowTicks == 0) found->periodic.add(tick);
}

double AnswerLoss::share() const noexcept {
  double largest = 0.0;
  for (const Answers& answers : hands_) {
    // of slow answers more than every third is periodic
    const bool is_slow = 3 * answers.periodic.count > answers.all.count;
    largest = std::max(largest, (is_slow ? answers.periodic : answers.all).lostShare());
  }
  return largest;
}

void ForceAgeStatistics::inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept {
  sent_[seq % kRing] = {seq, now_ns};
  if (last_sent_) lateness_.add(now_ns - *last_sent_ - period_ns);
  last_sent_ = now_ns;
}

void ForceAgeStatistics::answerReceived(HandId hand, Tick tick, std::uint32_t seq,
                                        std::int64_t now_ns) noexcept {
  loss_.received(hand, tick);
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
  telemetry.answers_lost = loss_.share();
  recent_ages_.clear();
  loss_.clear();
  telemetry.longest_silence = static_cast<double>(longest_gap_) * 1e-9;
}

}  // namespace tenon::haptic
