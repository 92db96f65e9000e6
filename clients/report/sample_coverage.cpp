#include "clients/report/sample_coverage.h"

#include <algorithm>

#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

constexpr Tick kManifoldPeriod = 10;  // [ticks] of each of which a reduced recording has the strongest one
constexpr Tick kStreamPeriod = 10;    // [ticks] the first sample of a stream of 100 Hz may come so late

}  // namespace

void SampleCoverage::add(const PublishedSamples& published) {
  if (published.last_tick < published.first_tick) return;
  Period& period = periods_[periodOf(published.first_tick)];
  period.first_tick = published.first_tick;
  // a resumed server states what it has published of a period that a former one began
  for (const TopicSamples& topic : published.topics) period.published[topic.topic] += topic.samples;
}

void SampleCoverage::addSample(std::string_view topic, Tick tick) {
  if (tick == 0) return;
  first_ = first_ == 0 ? tick : std::min(first_, tick);
  ++recorded_[std::string(topic)][periodOf(tick)];
}

void SampleCoverage::addManifold(HandId hand, Tick tick) {
  if (tick == 0) return;
  first_ = first_ == 0 ? tick : std::min(first_, tick);
  Tick& newest = newest_manifold_.try_emplace(hand, tick / kManifoldPeriod + 1).first->second;
  if (newest == tick / kManifoldPeriod) return;
  newest = tick / kManifoldPeriod;
  // the last tick of a period of PublishedSamples is the first one of 10: they count in the next period
  recorded_[std::string(wire::kHandManifold.name)][periodOf(newest * kManifoldPeriod + 1)] += kManifoldPeriod;
}

SampleCount SampleCoverage::between(std::string_view topic, Tick first, Tick last) const {
  SampleCount count;
  const auto recorded = recorded_.find(topic);
  const auto end = periods_.upper_bound(periodOf(last));
  for (auto period = periods_.lower_bound(periodOf(first)); period != end; ++period) {
    if (period->second.first_tick + kStreamPeriod <= first_) continue;
    const auto published = period->second.published.find(topic);
    if (published == period->second.published.end()) continue;
    count.published += published->second;
    if (recorded == recorded_.end()) continue;
    const auto in_period = recorded->second.find(period->first);
    if (in_period != recorded->second.end()) count.recorded += std::min(in_period->second, published->second);
  }
  return count;
}

}  // namespace tenon::report
