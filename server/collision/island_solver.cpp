#include "server/collision/island_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace tenon {
namespace {

/// [m] A body whose points all have less than this to go has arrived.
constexpr double kArrived = 1e-9;

/// [m] What may be left after the last sub-step without being called unfinished.
constexpr double kUnfinished = 1e-6;

/// A step back of more than this share of the last step means that the last one went too far.
constexpr double kOvershoot = 0.1;

/// Full lists shorten a sub-step to this share of its travel at most: a plate on a floor has to slide on.
constexpr double kLeastReach = 0.25;

/// A metre too deep costs this many times the forces of all springs: more than a wedge of them can gain by
/// it.
constexpr double kDepthPrice = 3.0;

/// [m] A depth that the field's steps and a turned contact may leave behind.
constexpr double kFieldNoise = 5e-6;

/// So many sub-steps in a row may end in a worse place before the solver goes back to the best.
constexpr int kWorsePlaces = 1;

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
      gone_(max_bodies),
      best_(max_bodies),
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
  for (MovableBody& body : job.bodies) body.brakes.clear();
  std::fill(gone_.begin(), gone_.end(), Displacement{});
  double best = std::numeric_limits<double>::infinity();
  double reach = job.limits.substep_travel;
  int worse = 0;
  const auto look = [&] {
    queryPairs(job, job.limits.contact_margin, report);
    buildRows(job);
    solveMotions(job, report);
  };

  while (true) {
    look();
    const double here = merit(job);
    if (here < best) {
      best = here;
      worse = 0;
      reach = std::min(2.0 * reach, job.limits.substep_travel);
      for (std::size_t i = 0; i < job.bodies.size(); ++i) best_[i] = job.bodies[i].X_WB;
    } else {
      ++worse;
      reach *= 0.5;
    }
    if (brakeOvershoot(job)) solveMotions(job, report);
    double way = travel(job);
    if (way < kArrived) break;
    const bool last = report.substeps == job.limits.substeps;
    // a place or two may be worse on the way to a better one, but not the end of the way
    if (worse > kWorsePlaces || (last && worse > 0)) {
      for (std::size_t i = 0; i < job.bodies.size(); ++i) {
        job.bodies[i].X_WB = best_[i];
        job.bodies[i].brakes.clear();
      }
      std::fill(gone_.begin(), gone_.end(), Displacement{});
      worse = 0;
      look();
      way = travel(job);
    }
    if (last) {
      report.travel_capped = way > kUnfinished;
      break;
    }
    // one share for all: between two admissible places every place is admissible
    move(job, std::min(1.0, std::min(reach, knownReach(job)) / way));
    ++report.substeps;
  }
  fillForces(job);
  for (MovableBody& body : job.bodies) body.brakes.clear();
}

double IslandSolver::merit(const Job& job) {
  double energy = 0.0;
  double force = 0.0;
  for (const MovableBody& body : job.bodies) {
    for (const Spring& spring : body.springs) {
      const Displacement toGoal = displacement(body.X_WB, spring.X_WG);
      const double stretch2 = (spring.X_WG * spring.p_BC - body.X_WB * spring.p_BC).squaredNorm();
      energy +=
          0.5 * (spring.stiffness * stretch2 + spring.rotational_stiffness * toGoal.rotation.squaredNorm());
      force += spring.stiffness * std::sqrt(stretch2) +
               spring.rotational_stiffness * toGoal.rotation.norm() / body.radius;
    }
  }
  double depth = 0.0;
  for (const IslandPairResult& result : job.results) depth = std::max(depth, -result.query.smallest_gap);
  return energy + kDepthPrice * force * std::max(depth - kFieldNoise, 0.0);
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

double IslandSolver::knownReach(const Job& job) {
  double reach = job.limits.substep_travel;
  for (const IslandPairResult& result : job.results) {
    if (result.query.counts.contacts_dropped > 0) reach = std::min(reach, result.query.listed_to);
  }
  return std::max(reach, kLeastReach * job.limits.substep_travel);
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
    gone_[i] = {share * motions_[i].translation, share * motions_[i].rotation};
    // nothing in the way: be there, not there up to the second order
    const bool arrives = share == 1.0 && touched_[i] == 0 && body.springs.size() == 1 &&
                         job.limits.method != ContactMethod::kBlocking;
    body.X_WB = arrives ? body.springs[0].X_WG : displaced(body.X_WB, gone_[i]);
  }
}

bool IslandSolver::brakeOvershoot(const Job& job) {
  bool braked = false;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    const double radius2 = body.radius * body.radius;
    const auto dot = [radius2](const Displacement& a, const Displacement& b) {
      return a.translation.dot(b.translation) + radius2 * a.rotation.dot(b.rotation);
    };
    const double way2 = dot(gone_[i], gone_[i]);
    const double back = -dot(gone_[i], motions_[i]);
    if (touched_[i] == 0 || way2 < kArrived * kArrived || back < kOvershoot * way2) continue;
    // secant: where the wish to move would have been zero
    if (body.brakes.push_back({gone_[i], back / way2})) braked = true;
  }
  return braked;
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
