#include "server/session/publisher.h"

#include <algorithm>
#include <cmath>

#include "idl/types/motion_law.h"

namespace tenon::session {
namespace {

constexpr Tick kPeriod50Hz = 20;  // [ticks]
constexpr Tick kPeriod30Hz = 33;  // [ticks]

// A slow manifold is sent at once (event-triggered) when a neighbour's goal is farther off from where the one
// before lets it be expected: above the resolution of encoders, which are in the velocities of single ticks.
constexpr double kGoalError = 3e-5;   // [m]
constexpr double kTurnRadius = 0.05;  // [m] at which an error of the orientation counts
constexpr Tick kLeastSpacing = 2;     // [ticks]
// Token bucket of each hand.
constexpr double kMostTokens = 12.0;  // a turn of 50 ms
constexpr double kTokensPerTick = 0.03;

/// [m] How far a goal is off from where `before`, `ahead` [s] earlier, lets it be expected (motion_law.h).
double goalError(const HandPull& before, const HandPull& now, double ahead) {
  Twist V_WG{before.V_WG.head<3>().cast<double>(), before.V_WG.tail<3>().cast<double>()};
  const double weight = extrapolationWeight(V_WG.linear.norm() + kTurnRadius * V_WG.angular.norm());
  V_WG = {weight * V_WG.linear, weight * V_WG.angular};
  const Pose X_WG = extrapolated(before.X_WG, V_WG, before.p_BoC_B, ahead);
  const Displacement off = displacement(X_WG, now.X_WG, now.p_BoC_B);
  return off.translation.norm() + kTurnRadius * off.rotation.norm();
}

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
  slow_samples_.resize(manifolds_.size());
  for (std::size_t i = 0; i < manifolds_.size(); ++i) {
    if (!output.present[i]) continue;
    // a tracked limb gets vibration and no force: 100 Hz suffices
    const bool is_coupled = scenario_->hands[i].kind == simulation::HandKind::kCoupled;
    const bool is_due = is_newest && (complete_ || is_coupled || output.tick % kPeriod100Hz == 0);
    manifolds_[i].hand = HandId{static_cast<std::uint32_t>(i)};
    manifolds_[i].server_epoch = server_epoch_;
    if (is_due) outgoing_.manifolds.push_back(&manifolds_[i]);
    if (is_50 || isTriggered(manifolds_[i], slow_samples_[i])) {
      slow_samples_[i].tick = output.tick;
      slow_samples_[i].others = manifolds_[i].others;
      outgoing_.manifolds_50.push_back(&manifolds_[i]);
    }
  }
}

/// A neighbour turns, stops or starts: told within kLeastSpacing, as long as there are tokens.
bool Publisher::isTriggered(const HandManifold& now, SlowSample& last) {
  const Tick since = now.tick - last.tick;
  if (last.tick == 0 || since < kLeastSpacing) return false;
  const auto isOff = [&](const HandPull& pull) {
    if (pull.object == now.object) return false;
    return std::any_of(last.others.begin(), last.others.end(), [&](const HandPull& before) {
      return before.hand == pull.hand && before.object == pull.object &&
             goalError(before, pull, static_cast<double>(since) * kTickSeconds) > kGoalError;
    });
  };
  if (std::none_of(now.others.begin(), now.others.end(), isOff)) return false;
  const double elapsed = static_cast<double>(now.tick - last.refilled);
  last.tokens = std::min(kMostTokens, last.tokens + kTokensPerTick * elapsed);
  last.refilled = now.tick;
  if (last.tokens < 1.0) return false;
  last.tokens -= 1.0;
  return true;
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
