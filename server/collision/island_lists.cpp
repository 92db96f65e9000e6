#include <algorithm>

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
    const IslandPair& pair = job.pairs[i];
    queryPair(
        {pair.shell_A, pair.field_B, job.poseA(pair), job.poseB(pair), pair.dilation, margin, pair.levels},
        job.results[i].query);
    ++report.queries;
    report.points_visited += job.results[i].query.counts.points_visited;
  }
}

void IslandSolver::lookAround(const Job& job, SolveReport& report) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    if (mustWalk(job, i)) {
      walkPair(job, i, report);
      held_.clear();
      continue;
    }
    const IslandPair& pair = job.pairs[i];
    PairQueryResult& result = job.results[i].query;
    const std::size_t listed = result.contacts.size();
    PairQuery query;
    query.shell_A = pair.shell_A;
    query.field_B = pair.field_B;
    query.X_WA = job.poseA(pair);
    query.X_WB = job.poseB(pair);
    query.dilation = pair.dilation;
    resampleContacts(query, approach(job, i), result);
    ++report.resamplings;
    report.points_visited += listed;
    if (result.contacts.size() != listed) held_.clear();
  }
}

void IslandSolver::walkPair(const Job& job, std::size_t i, SolveReport& report) {
  const IslandPair& pair = job.pairs[i];
  PairQuery query;
  query.shell_A = pair.shell_A;
  query.field_B = pair.field_B;
  query.X_WA = job.poseA(pair);
  query.X_WB = job.poseB(pair);
  query.dilation = pair.dilation;
  query.margin =
      neededMargin(pair, job.limits) + kWalkSubsteps * movableBodies(pair) * job.limits.substep_travel;
  query.levels = pair.levels;
  query.thin = true;
  queryPair(query, job.results[i].query);
  walked_[i] = {true, query.X_WA, query.X_WB};
  ++report.queries;
  report.points_visited += job.results[i].query.counts.points_visited;
}

double IslandSolver::approach(const Job& job, std::size_t i) const {
  const IslandPair& pair = job.pairs[i];
  double sum = 0.0;
  const auto add = [&](std::int32_t body, const Pose& X_WB_then) {
    if (body == GapRow::kStatic) return;
    const MovableBody& now = job.bodies[static_cast<std::size_t>(body)];
    const Displacement gone = displacement(X_WB_then, now.X_WB);
    sum += gone.translation.norm() + gone.rotation.norm() * now.radius;
  };
  add(pair.body_a, walked_[i].X_WA);
  add(pair.body_b, walked_[i].X_WB);
  return sum;
}

bool IslandSolver::mustWalk(const Job& job, std::size_t i) const {
  if (!walked_[i].done) return true;
  const IslandPair& pair = job.pairs[i];
  const PairQueryResult& result = job.results[i].query;
  const double gone = approach(job, i);
  // a full list is as good as it gets at the place where it was made
  if (gone > 0.0 && result.others_gap - gone < neededMargin(pair, job.limits)) return true;
  if (!result.thinned) return false;
  const Quaternion turn = (job.poseB(pair).rotation().conjugate() * job.poseA(pair).rotation()) *
                          (walked_[i].X_WB.rotation().conjugate() * walked_[i].X_WA.rotation()).conjugate();
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
}

double IslandSolver::knownReach(const Job& job) {
  double reach = job.limits.substep_travel;
  for (const IslandPairResult& result : job.results) {
    if (result.query.counts.contacts_dropped > 0) reach = std::min(reach, result.query.listed_to);
  }
  return std::max(reach, kLeastReach * job.limits.substep_travel);
}

}  // namespace tenon
