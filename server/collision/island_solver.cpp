#include "server/collision/island_solver.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace tenon {
namespace {

/// [m] A body whose points all have less than this to go has arrived.
constexpr double kArrived = 1e-9;

/// [m] A body that others hold back has arrived earlier: what is left is the field's steps of 1.5 um, which
/// change under every point as it goes.
constexpr double kSettled = 2e-6;

/// A walk lists this many sub-steps ahead, so that a tick's usual way needs no second one.
constexpr double kWalkSubsteps = 2.0;

/// [m] What a turn may cost in depth between listed points of a thinned list before it is made anew, and
/// how far apart those are at most.
constexpr double kThinDepth = 1e-5;
constexpr double kThinSpan = 0.03;

/// A surface's curve at a contact is seen this far to each side [voxels], and counts when its normal turns
/// by more than this over both [rad]: the field's steps turn it by less.
constexpr double kCurveStep = 0.25;
constexpr double kLeastTurn = 0.02;

/// [rad] So much turn over both sides, and the field's slope there, may be a kink between two of its cells.
constexpr double kSharpTurn = 0.1;
constexpr double kFlankSlope = 0.3;

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

/// [m] A body that has no more to go than this may find that the field's steps let it go nowhere.
constexpr double kLittleWay = 1e-4;

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
      walked_(max_pairs),
      multipliers_(max_pairs * kMaxPairContacts),
      motions_(max_bodies),
      gone_(max_bodies),
      best_(max_bodies),
      wrenches_(max_bodies),
      depths_(max_bodies),
      touched_(max_bodies) {
  rows_.reserve(max_pairs * kMaxPairContacts);
  held_.reserve(6 * max_bodies);
}

SolveReport IslandSolver::solve(std::span<MovableBody> bodies, std::span<const IslandPair> pairs,
                                const SolveLimits& limits, std::span<IslandPairResult> results) noexcept {
  assert(bodies.size() <= motions_.size() && results.size() == pairs.size());
  const Job job{bodies, pairs, limits, results};
  SolveReport report;
  held_.clear();
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
  double at_start = best;
  double reach = job.limits.substep_travel;
  int worse = 0;
  std::fill(walked_.begin(), walked_.end(), Walked{});
  flank_count_ = 0;
  const auto look = [&] {
    dropFlanks(job);
    lookAround(job, report);
    buildRows(job);
    for (MovableBody& body : job.bodies) body.curves.clear();
    solveMotions(job, report);
    if (findCurves(job)) solveMotions(job, report);
  };

  while (true) {
    look();
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
    if (brakeOvershoot(job)) solveMotions(job, report);
    double way = travel(job);
    const bool held = std::any_of(touched_.begin(), touched_.end(), [](std::uint8_t t) { return t != 0; });
    if (way < (held ? kSettled : kArrived)) break;
    const bool last = report.substeps == job.limits.substeps;
    // where the tick began is where the field's steps let it go: every way on is a way back
    const bool stays = best == at_start && worse > kWorsePlaces && way < kLittleWay;
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
      if (stays) break;
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
  for (MovableBody& body : job.bodies) {
    body.brakes.clear();
    body.curves.clear();
  }
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

namespace {

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

void IslandSolver::solveMotions(const Job& job, SolveReport& report) {
  const std::span<double> multipliers(multipliers_.data(), rows_.size());
  const MotionResult result =
      motion_.solve(job.bodies, rows_, std::span(motions_.data(), job.bodies.size()), multipliers, held_);
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

namespace {

/// A principal curve of a field's level set, hollow as seen from outside.
struct Hollow {
  Vector3 along_W = Vector3::Zero();
  double curvature = 0.0;  ///< [1/m]
};

/// The hollows round a contact: what pushes the point back to where it is, the more the farther it slides.
/// Where it turns abruptly, `flanks` takes the tangent planes to both sides: in a hollow they hold as well.
FixedVector<Hollow, 2> hollowsAt(const DistanceField& field, const Pose& X_WB, double dilation,
                                 const Contact& contact, FixedVector<Contact, 4>& flanks) {
  FixedVector<Hollow, 2> hollows;
  const Vector3 p_BP = X_WB.inverse() * contact.p_WP;
  const Vector3 n_B = X_WB.rotation().conjugate() * contact.n_W;
  const double h = kCurveStep * field.voxelAt(p_BP);
  const std::array<Vector3, 2> t = [&n_B] {
    Eigen::Index least = 0;
    n_B.cwiseAbs().minCoeff(&least);
    const Vector3 first = n_B.cross(Vector3::Unit(least)).normalized();
    return std::array{first, Vector3(n_B.cross(first))};
  }();
  Eigen::Matrix2d turn;
  for (int side = 0; side < 2; ++side) {
    const Vector3& along = t[static_cast<std::size_t>(side)];
    const FieldSample ahead = field.sample(p_BP + h * along);
    const FieldSample behind = field.sample(p_BP - h * along);
    if (!ahead.exact || !behind.exact) return hollows;
    turn(0, side) = (behind.gradient - ahead.gradient).dot(t[0]);
    turn(1, side) = (behind.gradient - ahead.gradient).dot(t[1]);
    if (turn(side, side) < kSharpTurn) continue;
    for (const double way : {h, -h}) {
      const FieldSample& sample = way > 0.0 ? ahead : behind;
      const double slope = sample.gradient.norm();
      if (slope < kFlankSlope) continue;
      Contact flank = contact;
      flank.gap = (sample.distance - dilation - way * sample.gradient.dot(along)) / slope;
      flank.n_W = X_WB.rotation() * (sample.gradient / slope);
      flank.area = 0.0;
      // elsewhere the surface bulges between here and there
      if (flank.gap >= contact.gap - kFieldNoise) flanks.push_back(flank);
    }
  }
  const double mean = 0.5 * (turn(0, 0) + turn(1, 1));
  const double half = 0.5 * (turn(0, 0) - turn(1, 1));
  const double mixed = 0.5 * (turn(0, 1) + turn(1, 0));
  const double spread = std::sqrt(half * half + mixed * mixed);
  for (const double sign : {1.0, -1.0}) {
    const double value = mean + sign * spread;
    if (value < kLeastTurn) continue;
    // of the two ways to write the eigenvector the longer one
    Vector3 along = half * sign >= 0.0 ? Vector3((spread + sign * half) * t[0] + sign * mixed * t[1])
                                       : Vector3(mixed * t[0] + (sign * spread - half) * t[1]);
    if (spread == 0.0) along = t[sign > 0.0 ? 0 : 1];
    hollows.push_back({X_WB.rotation() * along.normalized(), value / (2.0 * h)});
  }
  return hollows;
}

}  // namespace

bool IslandSolver::findCurves(const Job& job) {
  bool any = false;
  flank_count_ = 0;
  std::size_t i = 0;
  std::size_t first = 0;
  for (const std::uint32_t row : held_) {
    while (row >= first + job.results[i].query.contacts.size())
      first += job.results[i++].query.contacts.size();
    const IslandPair& pair = job.pairs[i];
    const Contact& contact = job.results[i].query.contacts[row - first];
    FixedVector<Contact, 4> flanks;
    const auto hollows = hollowsAt(*pair.field_B, job.poseB(pair), pair.dilation, contact, flanks);
    for (const Contact& flank : flanks) {
      if (flank_count_ < flanks_.size()) flanks_[flank_count_++] = {i, flank};
    }
    for (const Hollow& hollow : hollows) {
      for (const std::int32_t index : {pair.body_a, pair.body_b}) {
        if (index == GapRow::kStatic) continue;
        MovableBody& body = job.bodies[static_cast<std::size_t>(index)];
        const Vector3 arm = contact.p_WP - body.X_WB.translation();
        any |= body.curves.push_back(
            {{hollow.along_W, arm.cross(hollow.along_W)}, multipliers_[row] * hollow.curvature});
      }
    }
  }
  std::size_t listed = 0;
  for (std::size_t k = 0; k < flank_count_; ++k) {
    if (job.results[flanks_[k].pair].query.contacts.push_back(flanks_[k].contact))
      flanks_[listed++] = flanks_[k];
  }
  flank_count_ = listed;
  const bool flanked = listed > 0;
  if (flanked) {
    buildRows(job);
    held_.clear();
  }
  return any || flanked;
}

void IslandSolver::dropFlanks(const Job& job) {
  if (flank_count_ > 0) held_.clear();
  while (flank_count_ > 0) {
    ContactList& contacts = job.results[flanks_[--flank_count_].pair].query.contacts;
    contacts.resize(contacts.size() - 1);
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
