#include "server/session/publisher.h"

#include <algorithm>

namespace tenon::session {
namespace {

constexpr Tick kPeriod50Hz = 20;  // [ticks]
constexpr Tick kPeriod30Hz = 33;  // [ticks]

/// The contact of a pair that touched since the last sample and does so no more: apart, with its peaks.
PairContact separated(const PairContact& pair) {
  PairContact apart;
  apart.a = pair.a;
  apart.b = pair.b;
  apart.enabled = pair.enabled;
  apart.peak_force = pair.peak_force;
  apart.peak_depth = pair.peak_depth;
  return apart;
}

}  // namespace

Publisher::Publisher(std::shared_ptr<const game_control::ScenarioFile> scenario, std::uint32_t server_epoch,
                     bool complete)
    : scenario_(std::move(scenario)),
      server_epoch_(server_epoch),
      complete_(complete),
      event_generator_(scenario_, server_epoch),
      packer_1k_(server_epoch),
      packer_100_(server_epoch),
      packer_30_(server_epoch) {}

const OutgoingMessages& Publisher::prepare(const TickOutput& output, bool is_newest) {
  outgoing_.frames.clear();
  outgoing_.manifolds.clear();
  outgoing_.manifolds_50.clear();
  outgoing_.frames_100.clear();
  outgoing_.frames_30.clear();
  outgoing_.pairs.clear();
  outgoing_.stats.reset();
  outgoing_.progress.reset();
  if (is_newest) packer_1k_.pack(output, complete_, outgoing_.frames);
  addManifolds(output, is_newest);
  addPairs(output);
  addStats(output);
  if (output.tick % kPeriod100Hz == 0) packer_100_.pack(output, false, outgoing_.frames_100);
  if (output.tick % kPeriod30Hz == 0) {
    packer_30_.pack(output, true, outgoing_.frames_30);
    outgoing_.progress = game_control::progress(*scenario_, output.step, output.tick);
  }
  outgoing_.events = event_generator_.generate(output);
  return outgoing_;
}

void Publisher::addManifolds(const TickOutput& output, bool is_newest) {
  const bool is_50 = output.tick % kPeriod50Hz == 0;
  if (!is_newest && !is_50) return;
  manifolds_ = output.manifolds;
  for (std::size_t i = 0; i < manifolds_.size(); ++i) {
    if (!output.present[i]) continue;
    // a tracked limb gets vibration and no force: 100 Hz suffices
    const bool is_coupled = scenario_->hands[i].kind == simulation::HandKind::kCoupled;
    const bool is_due = is_newest && (complete_ || is_coupled || output.tick % kPeriod100Hz == 0);
    manifolds_[i].hand = HandId{static_cast<std::uint32_t>(i)};
    manifolds_[i].server_epoch = server_epoch_;
    if (is_due) outgoing_.manifolds.push_back(&manifolds_[i]);
    if (is_50) outgoing_.manifolds_50.push_back(&manifolds_[i]);
  }
}

void Publisher::addPairs(const TickOutput& output) {
  for (const PairState& state : output.pairs) {
    const PairContact& now = state.contact;
    PairRecord& record = pair_records_[state.pair];
    const PairContact before = record.contact;
    record.contact = now;
    record.contact.peak_force = std::max(before.peak_force, now.peak_force);
    record.contact.peak_depth = std::max(before.peak_depth, now.peak_depth);
    record.tick = output.tick;
    record.due = record.due || now.colliding;
  }
  if (output.tick % kPeriod100Hz != 0) return;

  for (const PairState& state : output.round_robin_pairs) {
    PairRecord& record = pair_records_[state.pair];
    if (record.due) continue;
    record.contact = state.contact;
    record.tick = output.tick;
    record.due = true;
  }
  for (auto& [index, record] : pair_records_) {
    if (!record.due) continue;
    PairContact& pair = record.contact;
    if (record.tick != output.tick) pair = separated(pair);
    if (outgoing_.pairs.empty() || outgoing_.pairs.back().pairs.full()) {
      outgoing_.pairs.emplace_back();
      outgoing_.pairs.back().tick = output.tick;
      outgoing_.pairs.back().part = static_cast<std::uint32_t>(outgoing_.pairs.size() - 1);
    }
    outgoing_.pairs.back().pairs.push_back(pair);
  }
  for (ContactPairs& sample : outgoing_.pairs)
    sample.parts = static_cast<std::uint32_t>(outgoing_.pairs.size());
  pair_records_.clear();
}

void Publisher::addStats(const TickOutput& output) {
  const TickStats& now = output.stats;
  const TickStats before = stats_peak_;
  stats_peak_ = now;
  stats_peak_.server_epoch = server_epoch_;
  stats_peak_.load_percent = std::max(before.load_percent, now.load_percent);
  stats_peak_.compute_seconds_max = std::max(before.compute_seconds_max, now.compute_seconds);
  stats_peak_.active_pairs = std::max(before.active_pairs, now.active_pairs);
  stats_peak_.queried_pairs = std::max(before.queried_pairs, now.queried_pairs);
  stats_peak_.points_visited = std::max(before.points_visited, now.points_visited);
  stats_peak_.input_age_seconds = std::max(before.input_age_seconds, now.input_age_seconds);
  if (output.tick % kPeriod100Hz != 0) return;
  outgoing_.stats = stats_peak_;
  stats_peak_ = {};
}

}  // namespace tenon::session
