#include "server/collision/island_solver.h"

#include <algorithm>
#include <cassert>

namespace tenon {
namespace {

/// [m] A body whose points all have less than this to go has arrived.
constexpr double kArrived = 1e-9;

/// [m] What may be left after the last sub-step without being called unfinished.
constexpr double kUnfinished = 1e-6;

/// How much of its depth the blocking baseline takes back in a sub-step: the paper gives none, more than this
/// makes the proxy jump at edges.
constexpr double kPushOutShare = 0.5;

}  // namespace

struct IslandSolver::Job {
  std::span<MovableBody> bodies;
  std::span<const IslandPair> pairs;
  const SolveLimits& limits;
  std::span<IslandPairResult> results;

  [[nodiscard]] const Pose& poseOf(std::int32_t body, const Pose& X_W_static) const {
    return body == GapRow::kStatic ? X_W_static : bodies[static_cast<std::size_t>(body)].X_WB;
  }
  [[nodiscard]] const Pose& poseA(const IslandPair& pair) const {
    return poseOf(pair.body_a, pair.X_WA_static);
  }
  [[nodiscard]] const Pose& poseB(const IslandPair& pair) const {
    return poseOf(pair.body_b, pair.X_WB_static);
  }
};

IslandSolver::IslandSolver(std::size_t max_bodies, std::size_t max_pairs)
    : motion_(max_bodies, max_pairs * kMaxPairContacts),
      multipliers_(max_pairs * kMaxPairContacts),
      motions_(max_bodies),
      wrenches_(max_bodies),
      depths_(max_bodies),
      touched_(max_bodies) {
  rows_.reserve(max_pairs * kMaxPairContacts);
}

SolveReport IslandSolver::solve(std::span<MovableBody> bodies, std::span<const IslandPair> pairs,
                                const SolveLimits& limits, std::span<IslandPairResult> results) noexcept {
  assert(bodies.size() <= motions_.size() && results.size() == pairs.size());
  const Job job{bodies, pairs, limits, results};
  SolveReport report;
  switch (limits.method) {
    case ContactMethod::kIsland:
      solveIsland(job, report);
      break;
    case ContactMethod::kBlocking:
      solveBlocking(job, report);
      break;
    case ContactMethod::kPenalty:
      solvePenalty(job, report);
      break;
  }
  return report;
}

void IslandSolver::solveIsland(const Job& job, SolveReport& report) {
  while (true) {
    queryPairs(job, job.limits.contact_margin, report);
    buildRows(job);
    solveMotions(job, report);
    const double way = travel(job);
    if (way < kArrived) break;
    if (report.substeps == job.limits.substeps) {
      report.travel_capped = way > kUnfinished;
      break;
    }
    // one share for all: between two admissible places every place is admissible
    move(job, std::min(1.0, job.limits.substep_travel / way));
    ++report.substeps;
  }
  fillForces(job);
}

void IslandSolver::solveBlocking(const Job& job, SolveReport& report) {
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

void IslandSolver::queryPairs(const Job& job, double margin, SolveReport& report) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    const int movable = (pair.body_a != GapRow::kStatic ? 1 : 0) + (pair.body_b != GapRow::kStatic ? 1 : 0);
    PairQuery query;
    query.shell_A = pair.shell_A;
    query.field_B = pair.field_B;
    query.X_WA = job.poseA(pair);
    query.X_WB = job.poseB(pair);
    query.dilation = pair.dilation;
    query.margin = margin > 0.0 ? margin + movable * job.limits.substep_travel : 0.0;
    query.levels = pair.levels;
    queryPair(query, job.results[i].query);
    ++report.queries;
    report.points_visited += job.results[i].query.counts.points_visited;
  }
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

void IslandSolver::solveMotions(const Job& job, SolveReport& report) {
  const std::span<double> multipliers(multipliers_.data(), rows_.size());
  const MotionResult result =
      motion_.solve(job.bodies, rows_, std::span(motions_.data(), job.bodies.size()), multipliers);
  report.iterations += result.iterations;
  report.conflicting = result.conflicting;

  std::fill(touched_.begin(), touched_.end(), std::uint8_t{0});
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    if (multipliers[r] <= 0.0) continue;
    for (const std::int32_t body : {rows_[r].body_a, rows_[r].body_b}) {
      if (body != GapRow::kStatic) touched_[static_cast<std::size_t>(body)] = 1;
    }
  }
}

double IslandSolver::travel(const Job& job) const {
  double farthest = 0.0;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    farthest = std::max(farthest,
                        motions_[i].translation.norm() + motions_[i].rotation.norm() * job.bodies[i].radius);
  }
  return farthest;
}

void IslandSolver::move(const Job& job, double share) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    if (share == 1.0 && touched_[i] == 0 && body.springs.size() == 1 &&
        job.limits.method != ContactMethod::kBlocking) {
      // nothing is in the way: be there, not there up to the second order
      body.X_WB = body.springs[0].X_WG;
      continue;
    }
    body.X_WB = displaced(body.X_WB, {share * motions_[i].translation, share * motions_[i].rotation});
  }
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

void IslandSolver::fillForces(const Job& job) const {
  std::size_t row = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    IslandPairResult& result = job.results[i];
    const Vector3& p_WAo = job.poseA(job.pairs[i]).translation();
    result.F_Ao_W = {};
    for (std::size_t c = 0; c < result.query.contacts.size(); ++c, ++row) {
      const Contact& contact = result.query.contacts[c];
      const double multiplier = contact.gap <= kTouchGap ? multipliers_[row] : 0.0;
      result.multipliers[c] = multiplier;
      const Vector3 f = multiplier * contact.n_W;
      result.F_Ao_W += {f, (contact.p_WP - p_WAo).cross(f)};
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
