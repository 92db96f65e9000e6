#include <algorithm>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [-] Fraction of a body's overlap that the blocking baseline removes per step. The paper gives none; with
/// more the proxy jumps at edges.
constexpr double kPushOutFraction = 0.5;

}  // namespace

void IslandSolver::solveBlocking(const Job& job, SolveReport& report) {
  active_.clear();
  while (true) {
    queryPairs(job, 0.0, report);
    rows_.clear();
    solveQp(job, report);
    blockOpposedMotion(job);
    const double length = stepLength(job);
    if (length < kStepTolerance) break;
    if (report.steps == job.limits.max_steps) {
      report.unconverged = length > kUnconverged;
      break;
    }
    std::fill(fractions_.begin(), fractions_.end(), std::min(1.0, job.limits.max_step_length / length));
    takeStep(job);
    ++report.steps;
  }
  fillPenaltyForces(job);
}

void IslandSolver::solvePenalty(const Job& job, SolveReport& report) {
  active_.clear();
  rows_.clear();
  while (true) {
    solveQp(job, report);
    const double length = stepLength(job);
    if (length < kStepTolerance) break;
    if (report.steps == job.limits.max_steps) {
      report.unconverged = length > kUnconverged;
      break;
    }
    std::fill(fractions_.begin(), fractions_.end(), std::min(1.0, job.limits.max_step_length / length));
    takeStep(job);
    ++report.steps;
  }
  queryPairs(job, 0.0, report);
  fillPenaltyForces(job);
}

void IslandSolver::blockOpposedMotion(const Job& job) {
  std::fill(wrenches_.begin(), wrenches_.end(), Wrench{});
  std::fill(depths_.begin(), depths_.end(), 0.0);
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    const PairQueryResult& query = job.results[i].query;
    const double depth = std::max(-query.smallest_gap, 0.0);
    const double stiffness = job.limits.penalty_stiffness;
    if (pair.body_a != ContactConstraint::kStatic) {
      const auto a = static_cast<std::size_t>(pair.body_a);
      wrenches_[a] += penaltyWrench(query, job.bodies[a].p_WQ(), stiffness);
      depths_[a] = std::max(depths_[a], depth);
    }
    if (pair.body_b != ContactConstraint::kStatic) {
      const auto b = static_cast<std::size_t>(pair.body_b);
      wrenches_[b] += -penaltyWrench(query, job.bodies[b].p_WQ(), stiffness);
      depths_[b] = std::max(depths_[b], depth);
    }
  }
  // remove the components of the step that oppose the summed force and the summed torque (paper §3.1)
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    Displacement& step = step_[i];
    if (wrenches_[i].force.squaredNorm() > 0.0) {
      const Vector3 n = wrenches_[i].force.normalized();
      step.translation += (std::max(-step.translation.dot(n), 0.0) + kPushOutFraction * depths_[i]) * n;
    }
    if (wrenches_[i].torque.squaredNorm() > 0.0) {
      const Vector3 n = wrenches_[i].torque.normalized();
      step.rotation += std::max(-step.rotation.dot(n), 0.0) * n;
    }
  }
}

void IslandSolver::fillPenaltyForces(const Job& job) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    IslandPairResult& result = job.results[i];
    result.F_Ao_W =
        penaltyWrench(result.query, job.poseA(job.pairs[i]).translation(), job.limits.penalty_stiffness);
    for (std::size_t c = 0; c < result.query.contacts.size(); ++c) {
      result.multipliers[c] = penaltyForce(result.query.contacts[c], job.limits.penalty_stiffness);
    }
  }
}

}  // namespace tenon::collision
