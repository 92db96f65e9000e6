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

void AnswerLoss::received(HandId hand, Tick tick) noexcept {
  const auto found = std::find_if(hands_.begin(), hands_.end(), [&](const Answers& answers) {
    return answers.count == 0 || answers.hand == hand;
  });
  if (found == hands_.end()) return;
  if (found->count == 0) *found = {hand, tick, tick, 0, 0};
  if (found->count > 0) {
    if (tick <= found->last) return;  // repeated or overtaken
    const Tick step = tick - found->last;
    found->step = found->step == 0 ? step : std::min(found->step, step);
    found->last = tick;
  }
  ++found->count;
}

double AnswerLoss::share() const noexcept {
  double largest = 0.0;
  for (const Answers& answers : hands_) {
    if (answers.step == 0) continue;
    const auto sent = static_cast<double>((answers.last - answers.first) / answers.step + 1);
    largest = std::max(largest, 1.0 - static_cast<double>(answers.count) / sent);
  }
  return std::max(0.0, largest);
}

void ForceAgeStatistics::inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept {
  sent_[seq % kRing] = {seq, now_ns};
  if (last_sent_ != 0) lateness_.add(now_ns - last_sent_ - period_ns);
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
  if (answered_at_ != 0) silence_ = std::max(silence_, now_ns - answered_at_);
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
  telemetry.longest_silence = static_cast<double>(silence_) * 1e-9;
}

}  // namespace tenon::haptic
