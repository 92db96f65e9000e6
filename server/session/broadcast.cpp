#include "server/session/broadcast.h"

#include <algorithm>

namespace tenon {
namespace {

constexpr Tick kThirtyHertz = 33;

/// A pair that touched since the last sample and lists no contacts any more.
PairContact partedFrom(const PairContact& pair) {
  PairContact apart;
  apart.a = pair.a;
  apart.b = pair.b;
  apart.enabled = pair.enabled;
  apart.peak_force = pair.peak_force;
  apart.peak_depth = pair.peak_depth;
  return apart;
}

}  // namespace

Broadcast::Broadcast(std::shared_ptr<const ScenarioFile> scenario, std::uint32_t server_epoch,
                     bool everything)
    : scenario_(std::move(scenario)),
      server_epoch_(server_epoch),
      everything_(everything),
      chronicle_(scenario_, server_epoch),
      packer_1k_(server_epoch),
      packer_100_(server_epoch),
      packer_30_(server_epoch) {}

const Outgoing& Broadcast::read(const TickOutput& output) {
  packer_1k_.pack(output, everything_, outgoing_.frames);
  outgoing_.frames_100.clear();
  outgoing_.frames_30.clear();
  outgoing_.pairs.clear();
  outgoing_.stats.reset();
  outgoing_.progress.reset();
  addManifolds(output);
  addPairs(output);
  addStats(output);
  if (output.tick % kHundredHertz == 0) packer_100_.pack(output, false, outgoing_.frames_100);
  if (output.tick % kThirtyHertz == 0) {
    packer_30_.pack(output, true, outgoing_.frames_30);
    outgoing_.progress = progress(*scenario_, output.step);
  }
  outgoing_.news = chronicle_.read(output);
  return outgoing_;
}

void Broadcast::addManifolds(const TickOutput& output) {
  manifolds_ = output.manifolds;
  outgoing_.manifolds.clear();
  for (std::size_t i = 0; i < manifolds_.size(); ++i) {
    if (!output.present[i]) continue;
    // a limb that is only tracked feels vibration, not force: a hundred times a second will do
    const bool is_felt = scenario_->hands[i].kind == HandKind::kCoupled;
    if (!everything_ && !is_felt && output.tick % kHundredHertz != 0) continue;
    manifolds_[i].hand = HandId{static_cast<std::uint32_t>(i)};
    manifolds_[i].server_epoch = server_epoch_;
    outgoing_.manifolds.push_back(&manifolds_[i]);
  }
}

void Broadcast::addPairs(const TickOutput& output) {
  for (const PairState& state : output.pairs) {
    const PairContact& now = state.contact;
    Touch& touch = touches_[state.pair];
    const PairContact before = touch.contact;
    touch.contact = now;
    touch.contact.peak_force = std::max(before.peak_force, now.peak_force);
    touch.contact.peak_depth = std::max(before.peak_depth, now.peak_depth);
    touch.tick = output.tick;
    touch.lately = touch.lately || now.colliding;
  }
  if (output.tick % kHundredHertz != 0) return;

  for (const PairState& state : output.pairs_in_turn) {
    Touch& touch = touches_[state.pair];
    if (touch.lately) continue;
    touch.contact = state.contact;
    touch.tick = output.tick;
    touch.lately = true;
  }
  for (auto& [number, touch] : touches_) {
    if (!touch.lately) continue;
    PairContact& pair = touch.contact;
    if (touch.tick != output.tick) pair = partedFrom(pair);
    if (outgoing_.pairs.empty() || outgoing_.pairs.back().pairs.full()) {
      outgoing_.pairs.emplace_back();
      outgoing_.pairs.back().tick = output.tick;
      outgoing_.pairs.back().part = static_cast<std::uint32_t>(outgoing_.pairs.size() - 1);
    }
    outgoing_.pairs.back().pairs.push_back(pair);
  }
  for (ContactPairs& sample : outgoing_.pairs)
    sample.parts = static_cast<std::uint32_t>(outgoing_.pairs.size());
  touches_.clear();
}

void Broadcast::addStats(const TickOutput& output) {
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
  if (output.tick % kHundredHertz != 0) return;
  outgoing_.stats = stats_peak_;
  stats_peak_ = {};
}

}  // namespace tenon
