#include <algorithm>
#include <utility>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// A walk lists this many sub-steps ahead, so that a tick's usual way needs no second one.
constexpr double kWalkSubsteps = 2.0;

/// [m] What a turn may cost in depth between listed points of a thinned list before it is made anew, and
/// how far apart those are at most.
constexpr double kThinDepth = 1e-5;
constexpr double kThinSpan = 0.03;

/// Full lists shorten a sub-step to this share of its travel at most: a plate on a floor has to slide on.
constexpr double kLeastReach = 0.25;

int movableBodies(const IslandPair& pair) {
  return (pair.body_a != GapRow::kStatic ? 1 : 0) + (pair.body_b != GapRow::kStatic ? 1 : 0);
}

/// [m] Up to this gap everything has to be listed before a sub-step: its travel, and what others want to see.
double neededMargin(const IslandPair& pair, const SolveLimits& limits) {
  return std::max(limits.contact_margin, movableBodies(pair) * limits.substep_travel);
}

}  // namespace

void IslandSolver::queryPairs(const Job& job, double margin, SolveReport& report) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    queryPair(job.queryOf(job.pairs[i], margin), job.results[i].query);
    job.results[i].walked = WalkedAt{};
    job.results[i].flanks = 0;
    job.results[i].slides = false;
    ++report.queries;
    report.points_visited += job.results[i].query.counts.points_visited;
  }
}

void IslandSolver::takeLast(const Job& job) {
  held_.clear();
  std::size_t rows = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    IslandPairResult& result = job.results[i];
    const IslandPairResult* last = pair.last;
    const bool slid = last != nullptr && last->slides;
    // what the solver does not move may have moved by itself
    if (last == nullptr || !last->walked.done || last->walked.levels != pair.levels ||
        (pair.body_a == GapRow::kStatic && !(last->walked.X_WA == pair.X_WA_static)) ||
        (pair.body_b == GapRow::kStatic && !(last->walked.X_WB == pair.X_WB_static))) {
      result.query.contacts.clear();
      result.walked = WalkedAt{};
    } else {
      if (last != &result) result = *last;
      result.query.contacts.resize(result.query.contacts.size() - result.flanks);
    }
    result.slid = slid;
    result.slides = false;
    for (std::size_t c = 0; c < result.query.contacts.size(); ++c, ++rows) {
      multipliers_[rows] = result.multipliers[c];
      // fewer bodies than then may be left
      const bool room = held_.size() < held_.capacity();
      if (multipliers_[rows] > 0.0 && room) held_.push_back(static_cast<std::uint32_t>(rows));
    }
  }
}

void IslandSolver::lookAround(const Job& job, SolveReport& report) {
  // what goes on holding: in lists that stay the same, under its new number, whatever other lists become
  kept_.clear();
  std::size_t next = 0;
  std::size_t first_before = 0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const std::size_t listed = job.results[i].query.contacts.size();
    const bool same = lookAtPair(job, i, report);
    for (; next < held_.size() && held_[next] < first_before + listed; ++next) {
      if (same) kept_.emplace_back(held_[next] - first_before + first, multipliers_[held_[next]]);
    }
    first_before += listed;
    first += job.results[i].query.contacts.size();
  }
  held_.clear();
  for (const auto& [row, force] : kept_) {
    held_.push_back(static_cast<std::uint32_t>(row));
    multipliers_[row] = force;
  }
}

bool IslandSolver::lookAtPair(const Job& job, std::size_t i, SolveReport& report) {
  const double gone = job.results[i].walked.done ? approach(job, i) : 0.0;
  if (mustWalk(job, i, gone)) {
    walkPair(job, i, report);
    return false;
  }
  PairQueryResult& result = job.results[i].query;
  const std::size_t listed = result.contacts.size();
  resampleContacts(job.queryOf(job.pairs[i], 0.0), gone, result);
  ++report.resamplings;
  report.points_visited += listed;
  return result.contacts.size() == listed;
}

void IslandSolver::walkPair(const Job& job, std::size_t i, SolveReport& report) {
  const IslandPair& pair = job.pairs[i];
  PairQuery query = job.queryOf(
      pair, neededMargin(pair, job.limits) + kWalkSubsteps * movableBodies(pair) * job.limits.substep_travel);
  query.levels = std::min(pair.levels, job.results[i].walked.used);
  query.thin = true;
  queryPair(query, job.results[i].query);
  job.results[i].walked = {true, query.X_WA, query.X_WB, pair.levels, job.results[i].query.levels_used};
  ++report.queries;
  report.points_visited += job.results[i].query.counts.points_visited;
}

double IslandSolver::approach(const Job& job, std::size_t i) {
  const IslandPair& pair = job.pairs[i];
  double sum = 0.0;
  const auto add = [&](std::int32_t body, const Pose& X_WB_then) {
    if (body == GapRow::kStatic) return;
    const MovableBody& now = job.bodies[static_cast<std::size_t>(body)];
    const Displacement gone = displacement(X_WB_then, now.X_WB);
    sum += fastestPoint(gone, now.radius);
  };
  add(pair.body_a, job.results[i].walked.X_WA);
  add(pair.body_b, job.results[i].walked.X_WB);
  return sum;
}

bool IslandSolver::mustWalk(const Job& job, std::size_t i, double gone) {
  const WalkedAt& walked = job.results[i].walked;
  if (!walked.done) return true;
  const IslandPair& pair = job.pairs[i];
  const PairQueryResult& result = job.results[i].query;
  // a full list is as good as it gets at the place where it was made
  if (gone > 0.0 && result.others_gap - gone < neededMargin(pair, job.limits)) return true;
  if (!result.thinned) return false;
  const Quaternion turn = (job.poseB(pair).rotation().conjugate() * job.poseA(pair).rotation()) *
                          (walked.X_WB.rotation().conjugate() * walked.X_WA.rotation()).conjugate();
  return 2.0 * turn.vec().norm() * kThinSpan > kThinDepth;
}

void IslandSolver::buildRows(const Job& job) {
  rows_.clear();
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    for (const Contact& contact : job.results[i].query.contacts) {
      rows_.push_back({pair.body_a, pair.body_b, contact.n_W, contact.p_WP, contact.gap});
    }
  }
  listed_ = rows_.size();
}

std::size_t IslandSolver::pairOfRow(const Job& job, std::size_t row) {
  std::size_t i = 0;
  for (std::size_t end = job.results[0].query.contacts.size(); row >= end;) {
    end += job.results[++i].query.contacts.size();
  }
  return i;
}

double IslandSolver::knownReach(const Job& job) {
  double reach = job.limits.substep_travel;
  for (const IslandPairResult& result : job.results) {
    if (result.query.counts.contacts_dropped > 0) reach = std::min(reach, result.query.listed_to);
  }
  return std::max(reach, kLeastReach * job.limits.substep_travel);
}

}  // namespace tenon
