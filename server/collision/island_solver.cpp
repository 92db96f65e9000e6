#include "server/collision/island_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// Once it has moved in a tick, so many times what counts as settled may be left for the next one.
constexpr double kLeftForNext = 2.5;

/// A step back of more than this share of the last step means that the last one went too far.
constexpr double kOvershoot = 0.1;

/// A metre too deep costs this many times the forces of all springs: more than a wedge of them can gain by
/// it.
constexpr double kDepthPrice = 3.0;

/// Points that hold after others have been let past their kinks are looked at again.
constexpr int kKinkRounds = 2;

/// So many sub-steps in a row may end in a worse place before the solver goes back to the best.
constexpr int kWorsePlaces = 1;

/// [m] A body that has no more to go than this may find that the field's steps let it go nowhere.
constexpr double kLittleWay = 1e-4;

}  // namespace

IslandSolver::IslandSolver(std::size_t max_bodies, std::size_t max_pairs)
    : motion_(max_bodies, max_pairs * kMaxPairContacts + kMaxFlanks + kPatchRows * kMaxPatches),
      multipliers_(max_pairs * kMaxPairContacts + kMaxFlanks + kPatchRows * kMaxPatches),
      motions_(max_bodies),
      free_motions_(max_bodies),
      gone_(max_bodies),
      best_(max_bodies),
      start_(max_bodies),
      wrenches_(max_bodies),
      depths_(max_bodies),
      touched_(max_bodies) {
  rows_.reserve(multipliers_.size());
  held_.reserve(6 * max_bodies);
  kept_.reserve(held_.capacity());
  curved_.reserve(6 * max_bodies);
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
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    start_[i] = job.bodies[i].X_WB;
    job.bodies[i].brakes.clear();
    job.bodies[i].pinned = false;
  }
  std::fill(gone_.begin(), gone_.end(), Displacement{});
  double best = std::numeric_limits<double>::infinity();
  double at_start = best;
  double reach = job.limits.substep_travel;
  int worse = 0;
  takeLast(job);

  // a step more costs a look, and perhaps one to come back
  std::uint64_t tested = 0;
  const auto isSpent = [&] {
    const std::uint64_t look_points = report.points_visited - tested;
    tested = report.points_visited;
    return report.points_visited + 2 * look_points > job.limits.points;
  };

  while (true) {
    look(job, report);
    const double here = merit(job);
    if (report.substeps == 0) at_start = here;
    if (here < best) {
      best = here;
      worse = 0;
      reach = std::min(2.0 * reach, job.limits.substep_travel);
      for (std::size_t i = 0; i < job.bodies.size(); ++i) best_[i] = job.bodies[i].X_WB;
    } else {
      ++worse;
      reach *= 0.5;
    }
    if (brakeOvershoot(job)) solveMotions(job, report, rows_.size());
    if (arrived(job, worse == 0 && report.substeps > 0 ? kLeftForNext : 1.0)) break;
    double way = travel(job);
    const bool spent = isSpent() && report.substeps > 0;
    const bool last = report.substeps == job.limits.substeps || spent;
    // where the tick began is where the field's steps let it go: every way on is a way back
    const bool stays = best == at_start && worse > kWorsePlaces && way < kLittleWay;
    // a place or two may be worse on the way to a better one, but not the end of the way
    if (worse > kWorsePlaces || (last && worse > 0)) {
      goBackToBest(job);
      worse = 0;
      look(job, report);
      way = travel(job);
      if (stays) break;
    }
    if (last) {
      report.travel_capped = way > kUnfinished;
      break;
    }
    // one share for all: between two admissible places every place is admissible
    move(job, std::min({1.0, std::min(reach, knownReach(job)) / way, shareWithinReach(job)}));
    ++report.substeps;
  }
  fillForces(job);
  for (MovableBody& body : job.bodies) {
    body.brakes.clear();
    body.curves.clear();
    body.drag_Bo_W = Wrench{};
  }
}

void IslandSolver::goBackToBest(const Job& job) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    job.bodies[i].X_WB = best_[i];
    job.bodies[i].brakes.clear();
  }
  std::fill(gone_.begin(), gone_.end(), Displacement{});
}

double IslandSolver::merit(const Job& job) {
  double energy = 0.0;
  double force = 0.0;
  for (const MovableBody& body : job.bodies) {
    for (const Spring& spring : body.springs) {
      const Displacement toGoal = displacement(body.X_WB, spring.X_WG);
      const double stretch = (spring.X_WG * spring.p_BC - body.X_WB * spring.p_BC).norm();
      energy += springEnergy(spring, body.X_WB);
      force += spring.stiffness * stretch + springTorque(spring, toGoal.rotation).norm() / body.radius;
    }
  }
  double depth = 0.0;
  for (const IslandPairResult& result : job.results) depth = std::max(depth, -result.query.smallest_gap);
  return energy + kDepthPrice * force * std::max(depth - kFieldNoise, 0.0);
}

void IslandSolver::look(const Job& job, SolveReport& report) {
  pinWhatHasGoneItsReach(job);
  lookAround(job, report);
  buildRows(job);
  // most often what held at the last place holds here too
  const bool expected = findCurves(job);
  solveMotions(job, report);
  for (int round = 0; round < kKinkRounds && passKinks(job, report);) ++round;
  if (!curvesAreOfHeld()) {
    const bool found = findCurves(job);
    if (expected || found) solveMotions(job, report, listed_);
  }
  rub(job, report);
}

void IslandSolver::solveMotions(const Job& job, SolveReport& report, std::size_t unchanged) {
  const std::span<double> multipliers(multipliers_.data(), rows_.size());
  const std::span<Displacement> motions(motions_.data(), job.bodies.size());
  const MotionResult result = motion_.solve(job.bodies, rows_, motions, multipliers, held_, unchanged);
  report.iterations += result.iterations;
  report.conflicting = result.conflicting;

  std::fill(touched_.begin(), touched_.end(), std::uint8_t{0});
  held_.clear();
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    if (multipliers[r] <= 0.0) continue;
    held_.push_back(static_cast<std::uint32_t>(r));
    for (const std::int32_t body : {rows_[r].body_a, rows_[r].body_b}) {
      if (body != GapRow::kStatic) touched_[static_cast<std::size_t>(body)] = 1;
    }
  }
}

double IslandSolver::travel(const Job& job) const {
  double farthest = 0.0;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    farthest = std::max(farthest, fastestPoint(motions_[i], job.bodies[i].radius));
  }
  return farthest;
}

bool IslandSolver::arrived(const Job& job, double slack) const {
  const bool held = std::any_of(touched_.begin(), touched_.end(), [](std::uint8_t t) { return t != 0; });
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    const MovableBody& body = job.bodies[i];
    if (fastestPoint(motions_[i], body.radius) >= (held ? slack * body.settled : kArrived)) return false;
  }
  return true;
}

double IslandSolver::shareWithinReach(const Job& job) const {
  double share = 1.0;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    const MovableBody& body = job.bodies[i];
    const double way = fastestPoint(motions_[i], body.radius);
    if (body.pinned || way < kArrived) continue;
    share =
        std::min(share, (body.reach - fastestPoint(displacement(start_[i], body.X_WB), body.radius)) / way);
  }
  return std::max(share, 0.0);
}

void IslandSolver::pinWhatHasGoneItsReach(const Job& job) const {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    if (!std::isfinite(body.reach)) continue;
    const double gone = fastestPoint(displacement(start_[i], body.X_WB), body.radius);
    body.pinned = body.reach - gone < kArrived;
  }
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

void IslandSolver::fillForces(const Job& job) const {
  std::size_t row = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    IslandPairResult& result = job.results[i];
    result.F_Ao_W = {};
    result.flanks = 0;
    const std::size_t listed = result.query.contacts.size();
    for (std::size_t c = 0; c < listed; ++c) fillForce(job, i, c, multipliers_[row++]);
  }
  for (std::size_t k = 0; k < flank_count_; ++k) {
    ContactList& contacts = job.results[flanks_[k].pair].query.contacts;
    const std::size_t c = contacts.size();
    if (contacts.push_back(flanks_[k].contact)) {
      ++job.results[flanks_[k].pair].flanks;
      fillForce(job, flanks_[k].pair, c, multipliers_[row]);
    }
    ++row;
  }
  fillFriction(job);
}

void IslandSolver::fillForce(const Job& job, std::size_t pair, std::size_t c, double multiplier) {
  IslandPairResult& result = job.results[pair];
  const Contact& contact = result.query.contacts[c];
  const double force = contact.gap <= kTouchGap ? multiplier : 0.0;
  result.multipliers[c] = force;
  const Vector3 f = force * contact.n_W;
  result.F_Ao_W += {f, (contact.p_WP - job.poseA(job.pairs[pair]).translation()).cross(f)};
}

}  // namespace tenon
