#include "clients/haptic/force_age_statistics.h"

#include <algorithm>

namespace tenon::haptic {

void DurationHistogram::add(std::int64_t nanoseconds) noexcept {
  const std::int64_t duration = std::max<std::int64_t>(0, nanoseconds);
  ++bins_[std::min(kBins - 1, static_cast<std::size_t>(duration / kBin))];
  ++count_;
  max_ = std::max(max_, duration);
}

double DurationHistogram::quantile(double fraction) const noexcept {
  const auto rank = static_cast<std::uint64_t>(fraction * static_cast<double>(count_));
  std::uint64_t passed = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    passed += bins_[bin];
    if (passed > rank) return static_cast<double>(bin + 1) * static_cast<double>(kBin) * 1e-9;
  }
  return passed > 0 ? max() : 0.0;
}

void ForceAgeStatistics::inputSent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept {
  sent_[seq % kRing] = {seq, now_ns};
  if (last_sent_ != 0) lateness_.add(now_ns - last_sent_ - period_ns);
  last_sent_ = now_ns;
}

void ForceAgeStatistics::answerReceived(std::uint32_t seq, std::int64_t now_ns) noexcept {
  // the manifolds of all hands answer the same input: only the first counts
  if (seq == 0 || seq <= newest_answer_) return;
  const Sent& sent = sent_[seq % kRing];
  if (sent.seq != seq) return;
  newest_answer_ = seq;
  ages_.add(now_ns - sent.time);
}

void ForceAgeStatistics::fill(Telemetry& telemetry) const noexcept {
  telemetry.samples = ages_.count();
  telemetry.input_to_force_p50 = ages_.quantile(0.5);
  telemetry.input_to_force_p99 = ages_.quantile(0.99);
  telemetry.input_to_force_max = ages_.max();
  telemetry.loop_late_p99 = lateness_.quantile(0.99);
}

}  // namespace tenon::haptic
