#include <algorithm>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// How much of its depth the blocking baseline takes back in a sub-step: the paper gives none, more than this
/// makes the proxy jump at edges.
constexpr double kPushOutShare = 0.5;

}  // namespace

void IslandSolver::solveBlocking(const Job& job, SolveReport& report) {
  held_.clear();
  while (true) {
    queryPairs(job, 0.0, report);
    rows_.clear();
    solveMotions(job, report);
    blockMotions(job);
    const double way = travel(job);
    if (way < kArrived) break;
    if (report.substeps == job.limits.substeps) {
      report.travel_capped = way > kUnfinished;
      break;
    }
    move(job, std::min(1.0, job.limits.substep_travel / way));
    ++report.substeps;
  }
  fillPenalties(job);
}

void IslandSolver::solvePenalty(const Job& job, SolveReport& report) {
  held_.clear();
  rows_.clear();
  while (true) {
    solveMotions(job, report);
    const double way = travel(job);
    if (way < kArrived) break;
    if (report.substeps == job.limits.substeps) {
      report.travel_capped = way > kUnfinished;
      break;
    }
    move(job, std::min(1.0, job.limits.substep_travel / way));
    ++report.substeps;
  }
  queryPairs(job, 0.0, report);
  fillPenalties(job);
}

void IslandSolver::blockMotions(const Job& job) {
  std::fill(wrenches_.begin(), wrenches_.end(), Wrench{});
  std::fill(depths_.begin(), depths_.end(), 0.0);
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    const PairQueryResult& query = job.results[i].query;
    const double depth = std::max(-query.smallest_gap, 0.0);
    const double stiffness = job.limits.penalty_stiffness;
    if (pair.body_a != GapRow::kStatic) {
      const auto a = static_cast<std::size_t>(pair.body_a);
      wrenches_[a] += penaltyWrench(query, job.poseA(pair).translation(), stiffness);
      depths_[a] = std::max(depths_[a], depth);
    }
    if (pair.body_b != GapRow::kStatic) {
      const auto b = static_cast<std::size_t>(pair.body_b);
      wrenches_[b] += -penaltyWrench(query, job.poseB(pair).translation(), stiffness);
      depths_[b] = std::max(depths_[b], depth);
    }
  }
  // take away what opposes the summed force and the summed torque (paper §3.1)
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    Displacement& motion = motions_[i];
    if (wrenches_[i].force.squaredNorm() > 0.0) {
      const Vector3 n = wrenches_[i].force.normalized();
      motion.translation += (std::max(-motion.translation.dot(n), 0.0) + kPushOutShare * depths_[i]) * n;
    }
    if (wrenches_[i].torque.squaredNorm() > 0.0) {
      const Vector3 n = wrenches_[i].torque.normalized();
      motion.rotation += std::max(-motion.rotation.dot(n), 0.0) * n;
    }
  }
}

void IslandSolver::fillPenalties(const Job& job) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    IslandPairResult& result = job.results[i];
    result.F_Ao_W =
        penaltyWrench(result.query, job.poseA(job.pairs[i]).translation(), job.limits.penalty_stiffness);
    for (std::size_t c = 0; c < result.query.contacts.size(); ++c) {
      result.multipliers[c] = penaltyForce(result.query.contacts[c], job.limits.penalty_stiffness);
    }
  }
}

}  // namespace tenon
