#include "clients/haptic/force_age.h"

#include <algorithm>

namespace tenon {

void DurationHistogram::add(std::int64_t nanoseconds) noexcept {
  const std::int64_t duration = std::max<std::int64_t>(0, nanoseconds);
  ++bins_[std::min(kBins - 1, static_cast<std::size_t>(duration / kBin))];
  ++count_;
  longest_ = std::max(longest_, duration);
}

double DurationHistogram::quantile(double share) const noexcept {
  const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(count_));
  std::uint64_t passed = 0;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    passed += bins_[bin];
    if (passed > wanted) return static_cast<double>(bin + 1) * static_cast<double>(kBin) * 1e-9;
  }
  return passed > 0 ? longest() : 0.0;
}

void ForceAge::sent(std::uint32_t seq, std::int64_t now_ns, std::int64_t period_ns) noexcept {
  sent_[seq % kRing] = {seq, now_ns};
  if (last_sent_ != 0) late_.add(now_ns - last_sent_ - period_ns);
  last_sent_ = now_ns;
}

void ForceAge::answered(std::uint32_t seq, std::int64_t now_ns) noexcept {
  // one answer counts once, whichever hand's manifold brings it
  if (seq == 0 || seq <= newest_) return;
  const Sent& sent = sent_[seq % kRing];
  if (sent.seq != seq) return;
  newest_ = seq;
  ages_.add(now_ns - sent.at);
}

void ForceAge::fill(Telemetry& telemetry) const noexcept {
  telemetry.samples = ages_.count();
  telemetry.input_to_force_p50 = ages_.quantile(0.5);
  telemetry.input_to_force_p99 = ages_.quantile(0.99);
  telemetry.input_to_force_max = ages_.longest();
  telemetry.loop_late_p99 = late_.quantile(0.99);
}

}  // namespace tenon
