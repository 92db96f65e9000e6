#include "server/collision/island_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [-] Factor on the convergence tolerance after the first step of a solve: the next tick continues.
constexpr double kRelaxedTolerance = 2.5;

/// [-] A step that goes back by more than this fraction of the last one shows that the last one overshot.
constexpr double kOvershoot = 0.1;

/// [-] Penetration weight of the merit function, relative to the sum of the springs' forces: springs that
/// wedge a body in gain less energy by an overlap than it costs.
constexpr double kPenetrationWeight = 3.0;

/// Rounds of seam relaxation: a round may activate further contacts at seams.
constexpr int kSeamRounds = 2;

/// So many steps in a row may fail to lower the merit function; one more, and all of them are rejected.
constexpr int kMaxNonmonotoneSteps = 1;

/// So many steps in a row may leave an overlap into which a step has led; their iterates need not be better.
constexpr int kMaxRestorations = 4;

/// [-] A solve whose bodies are no better off than at its start may do so many times SolveLimits::work.
constexpr std::uint64_t kMostWork = 3;

/// [m] A step shorter than this may be blocked by the field's discretisation alone.
constexpr double kSmallStep = 1e-4;

/// Whether a step goes to the goal of the body's only spring, but for terms of second order: nothing else, as
/// a limit or a stiffening, shortened it. Such a body is put there exactly.
bool reachesGoal(const MovableBody& body, const Displacement& step_W) {
  constexpr double kSecondOrder = 0.01;  // [-] of the step
  if (body.springs.size() != 1) return false;
  const Displacement to_goal = displacement(body.X_WB, body.springs[0].X_WG, body.p_BQ);
  const double rest = maxPointMotion(
      {to_goal.translation - step_W.translation, to_goal.rotation - step_W.rotation}, body.radius);
  return rest <= kSecondOrder * maxPointMotion(step_W, body.radius) + kStepTolerance;
}

}  // namespace

IslandSolver::IslandSolver(std::size_t max_bodies, std::size_t max_pairs)
    : motion_(max_bodies, max_pairs * kMaxPairContacts + kMaxSecondaryPlanes + kPatchRows * kMaxPatches),
      multipliers_(max_pairs * kMaxPairContacts + kMaxSecondaryPlanes + kPatchRows * kMaxPatches),
      step_(max_bodies),
      step_without_seams_(max_bodies),
      lengths_(max_bodies),
      clearances_(max_pairs),
      fractions_(max_bodies),
      leaders_(max_bodies),
      last_step_(max_bodies),
      best_iterate_(max_bodies),
      initial_poses_(max_bodies),
      springs_(max_bodies),
      wrenches_(max_bodies),
      depths_(max_bodies),
      constrained_(max_bodies) {
  rows_.reserve(multipliers_.size());
  active_.reserve(6 * max_bodies);
  carried_.reserve(active_.capacity());
  curvature_rows_.reserve(6 * max_bodies);
  inside_cell_.resize(multipliers_.size());
  released_.resize(multipliers_.size());
}

SolveReport IslandSolver::solve(std::span<MovableBody> bodies, std::span<const IslandPair> pairs,
                                const SolveLimits& limits, std::span<IslandPairResult> results) noexcept {
  assert(bodies.size() <= step_.size() && results.size() == pairs.size());
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
    initial_poses_[i] = job.bodies[i].X_WB;
    job.bodies[i].stiffenings.clear();
    job.bodies[i].pinned = false;
  }
  std::fill(last_step_.begin(), last_step_.end(), Displacement{});
  double best = std::numeric_limits<double>::infinity();
  double at_start = best, overlap_at_start = 0.0;
  double trust_radius = job.limits.max_step_length;
  bool restores = false;  // the last step left an overlap
  int restorations = 0;   // in a row
  int nonmonotone = 0;
  std::uint32_t free_steps = 0;
  warmStart(job);

  // a further step costs one evaluation, and perhaps another one at the best iterate
  std::uint64_t points_before = 0;
  const auto isBudgetSpent = [&] {
    const std::uint64_t evaluation_points = report.points_visited - points_before;
    points_before = report.points_visited;
    return report.points_visited + 2 * evaluation_points > job.limits.points;
  };

  while (true) {
    const std::uint64_t work_before = report.work;
    computeStep(job, report);
    const double here = merit(job);
    if (report.steps == 0) at_start = here, overlap_at_start = deepestOverlap(job);
    if (here < best) {
      best = here;
      nonmonotone = 0;
      trust_radius = std::min(2.0 * trust_radius, job.limits.max_step_length);
      for (std::size_t i = 0; i < job.bodies.size(); ++i) best_iterate_[i] = job.bodies[i].X_WB;
    } else if (!restores) {
      ++nonmonotone;
      trust_radius *= 0.5;
    }
    if (dampOvershoot(job)) solveQp(job, report, rows_.size());
    if (converged(job, nonmonotone == 0 && report.steps > 0 ? kRelaxedTolerance : 1.0)) break;
    double length = stepLength(job);
    const bool certified = nonmonotone == 0 && !restores && best < at_start &&
                           deepestOverlap(job) <= std::max(overlap_at_start, kFieldNoise);
    report.work_limited = report.steps > 0 && isWorkSpent(job, report, report.work - work_before, certified);
    const bool spent = (isBudgetSpent() && report.steps > 0) || report.work_limited;
    const bool last =
        report.steps - free_steps == job.limits.max_steps || free_steps == job.limits.max_free_steps || spent;
    // no small step from the initial poses lowers the merit function: the bodies stay there
    const bool stays = best == at_start && nonmonotone > kMaxNonmonotoneSteps && length < kSmallStep;
    // an iterate may be worse on the path to a better one, but not the last iterate
    if (nonmonotone > kMaxNonmonotoneSteps || (last && nonmonotone > 0)) {
      restoreBestIterate(job);
      nonmonotone = 0;
      computeStep(job, report);
      length = stepLength(job);
      if (stays) break;
    }
    if (last) {
      report.unconverged = length > kUnconverged;
      break;
    }
    restores = overlap_at_start <= kTouchGap && restorations < kMaxRestorations && length > trust_radius &&
               deepestOverlap(job) > kTouchGap;
    restorations = restores ? restorations + 1 : 0;
    if (restores) computeRestoration(job, report);
    const double trust = restores ? job.limits.max_step_length : trust_radius;
    if (limitStep(job, std::min(trust, validityRadius(job)))) ++free_steps;
    takeStep(job);
    ++report.steps;
  }
  fillForces(job);
  for (MovableBody& body : job.bodies) {
    body.stiffenings.clear();
    body.curvatures.clear();
    body.friction_Bq_W = Wrench{};
  }
}

bool IslandSolver::isWorkSpent(const Job& job, const SolveReport& report, std::uint64_t last,
                               bool certified) {
  const std::uint64_t needed = report.work + last;
  return needed / (certified ? 1 : kMostWork) > job.limits.work;
}

void IslandSolver::restoreBestIterate(const Job& job) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    job.bodies[i].X_WB = best_iterate_[i];
    job.bodies[i].stiffenings.clear();
  }
  std::fill(last_step_.begin(), last_step_.end(), Displacement{});
}

double IslandSolver::merit(const Job& job) {
  double energy = 0.0;
  double force = 0.0;
  for (const MovableBody& body : job.bodies) {
    for (const Spring& spring : body.springs) {
      const Displacement to_goal = displacement(body.X_WB, spring.X_WG);
      const double stretch = (spring.X_WG * spring.p_BC - body.X_WB * spring.p_BC).norm();
      energy += springEnergy(spring, body.X_WB);
      force += spring.stiffness * stretch + springTorque(spring, to_goal.rotation).norm() / body.radius;
    }
  }
  return energy + kPenetrationWeight * force * std::max(deepestOverlap(job) - kFieldNoise, 0.0);
}

double IslandSolver::deepestOverlap(const Job& job) {
  double depth = 0.0;
  for (const IslandPairResult& result : job.results) depth = std::max(depth, result.query.deepest);
  return depth;
}

void IslandSolver::computeRestoration(const Job& job, SolveReport& report) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    springs_[i] = body.springs;
    for (Spring& spring : body.springs) spring.X_WG = body.X_WB;
  }
  solveQp(job, report);
  for (std::size_t i = 0; i < job.bodies.size(); ++i) job.bodies[i].springs = springs_[i];
}

void IslandSolver::evaluateConstraints(const Job& job, SolveReport& report) {
  updateContacts(job, report);
  buildConstraints(job);
}

void IslandSolver::computeStep(const Job& job, SolveReport& report) {
  pinBodiesAtLimit(job);
  evaluateConstraints(job, report);
  // the active set seldom changes between iterates
  const bool expected = evaluateCurvature(job);
  solveQp(job, report);
  for (int round = 0; round < kSeamRounds; ++round) {
    // surfaces hold a body while it is found whether edges do
    const bool at_edges = relaxSeamNormals(job, SeamKind::kEdge, report);
    const bool at_borders = relaxSeamNormals(job, SeamKind::kBorder, report);
    if (!at_edges && !at_borders) break;
  }
  if (!curvatureIsOfActiveRows()) {
    const bool found = evaluateCurvature(job);
    if (expected || found) solveQp(job, report, contact_row_count_);
  }
  solveFriction(job, report);
}

void IslandSolver::solveQp(const Job& job, SolveReport& report, std::size_t unchanged) {
  const std::span<double> multipliers(multipliers_.data(), rows_.size());
  const std::span<Displacement> step(step_.data(), job.bodies.size());
  const MotionResult result = motion_.solve(job.bodies, rows_, step, multipliers, active_, unchanged);
  report.iterations += result.iterations;
  report.infeasible = result.infeasible;

  std::fill(constrained_.begin(), constrained_.end(), std::uint8_t{0});
  active_.clear();
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    if (multipliers[r] <= 0.0) continue;
    active_.push_back(static_cast<std::uint32_t>(r));
    for (const std::int32_t body : {rows_[r].body_a, rows_[r].body_b}) {
      if (body != ContactConstraint::kStatic) constrained_[static_cast<std::size_t>(body)] = 1;
    }
  }
}

double IslandSolver::stepLength(const Job& job) const {
  double farthest = 0.0;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    farthest = std::max(farthest, maxPointMotion(step_[i], job.bodies[i].radius));
  }
  return farthest;
}

bool IslandSolver::converged(const Job& job, double slack) const {
  const bool in_contact =
      std::any_of(constrained_.begin(), constrained_.end(), [](std::uint8_t t) { return t != 0; });
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    const MovableBody& body = job.bodies[i];
    if (maxPointMotion(step_[i], body.radius) >= (in_contact ? slack * body.tolerance : kStepTolerance))
      return false;
  }
  return true;
}

bool IslandSolver::limitStep(const Job& job, double trust) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    lengths_[i] = maxPointMotion(step_[i], job.bodies[i].radius);
    fractions_[i] = fractionWithinLimit(job.bodies[i], i);
    leaders_[i] = i;
  }
  const auto lengthOf = [this](std::int32_t body) {
    return body == ContactConstraint::kStatic ? 0.0 : lengths_[static_cast<std::size_t>(body)];
  };
  for (std::size_t p = 0; p < job.pairs.size(); ++p) {
    const IslandPair& pair = job.pairs[p];
    clearances_[p] = clearanceOf(job, p);
    if (pair.body_a == ContactConstraint::kStatic || pair.body_b == ContactConstraint::kStatic) continue;
    if (lengthOf(pair.body_a) + lengthOf(pair.body_b) <= clearances_[p]) continue;
    const std::size_t a = leaderOf(static_cast<std::size_t>(pair.body_a));
    const std::size_t b = leaderOf(static_cast<std::size_t>(pair.body_b));
    leaders_[std::max(a, b)] = std::min(a, b);
    fractions_[std::min(a, b)] = std::min(fractions_[a], fractions_[b]);
  }
  bool before_contact = false;
  bool by_trust = false;
  for (std::size_t p = 0; p < job.pairs.size(); ++p) {
    const IslandPair& pair = job.pairs[p];
    const double clearance = clearances_[p];
    const double approach = lengthOf(pair.body_a) + lengthOf(pair.body_b);
    if (approach <= clearance) continue;
    const double free = clearance / approach;
    const double trusted = trust / std::max(lengthOf(pair.body_a), lengthOf(pair.body_b));
    const std::int32_t body = pair.body_a == ContactConstraint::kStatic ? pair.body_b : pair.body_a;
    double& fraction = fractions_[leaderOf(static_cast<std::size_t>(body))];
    fraction = std::min(fraction, std::max(free, trusted));
    (free > trusted ? before_contact : by_trust) |= std::max(free, trusted) < 1.0;
  }
  // leaders come first
  for (std::size_t i = 0; i < job.bodies.size(); ++i) fractions_[i] = fractions_[leaderOf(i)];
  return before_contact && !by_trust;
}

std::size_t IslandSolver::leaderOf(std::size_t i) const {
  while (leaders_[i] != i) i = leaders_[i];
  return i;
}

double IslandSolver::fractionWithinLimit(const MovableBody& body, std::size_t i) const {
  if (body.pinned || lengths_[i] < kStepTolerance) return 1.0;
  const double moved = maxPointMotion(displacement(initial_poses_[i], body.X_WB, body.p_BQ), body.radius);
  return std::clamp((body.max_displacement - moved) / lengths_[i], 0.0, 1.0);
}

void IslandSolver::pinBodiesAtLimit(const Job& job) const {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    if (!std::isfinite(body.max_displacement)) continue;
    const double moved = maxPointMotion(displacement(initial_poses_[i], body.X_WB, body.p_BQ), body.radius);
    body.pinned = body.max_displacement - moved < kStepTolerance;
  }
}

void IslandSolver::takeStep(const Job& job) {
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    const double fraction = fractions_[i];
    last_step_[i] = {fraction * step_[i].translation, fraction * step_[i].rotation};
    const bool at_goal = fraction == 1.0 && constrained_[i] == 0 && reachesGoal(body, last_step_[i]) &&
                         job.limits.method != ContactMethod::kBlocking;
    body.X_WB = at_goal ? body.springs[0].X_WG : displaced(body.X_WB, last_step_[i], body.p_BQ);
  }
}

bool IslandSolver::dampOvershoot(const Job& job) {
  bool damped = false;
  for (std::size_t i = 0; i < job.bodies.size(); ++i) {
    MovableBody& body = job.bodies[i];
    const double radius2 = body.radius * body.radius;
    const auto dot = [radius2](const Displacement& a, const Displacement& b) {
      return a.translation.dot(b.translation) + radius2 * a.rotation.dot(b.rotation);
    };
    const double last2 = dot(last_step_[i], last_step_[i]);
    const double back = -dot(last_step_[i], step_[i]);
    if (constrained_[i] == 0 || last2 < kStepTolerance * kStepTolerance || back < kOvershoot * last2)
      continue;
    // secant: with this stiffness the last step would have ended where the step along it is zero
    if (body.stiffenings.push_back({last_step_[i], back / last2})) damped = true;
  }
  return damped;
}

void IslandSolver::fillForces(const Job& job) const {
  std::size_t row = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    IslandPairResult& result = job.results[i];
    result.F_Ao_W = {};
    result.secondary_planes = 0;
    const std::size_t listed = result.query.contacts.size();
    for (std::size_t c = 0; c < listed; ++c) addForce(job, i, c, multipliers_[row++]);
  }
  for (std::size_t k = 0; k < secondary_plane_count_; ++k) {
    ContactList& contacts = job.results[secondary_planes_[k].pair].query.contacts;
    const std::size_t c = contacts.size();
    if (contacts.push_back(secondary_planes_[k].contact)) {
      ++job.results[secondary_planes_[k].pair].secondary_planes;
      addForce(job, secondary_planes_[k].pair, c, multipliers_[row]);
    }
    ++row;
  }
  addFriction(job);
}

void IslandSolver::addForce(const Job& job, std::size_t pair, std::size_t c, double multiplier) {
  IslandPairResult& result = job.results[pair];
  const Contact& contact = result.query.contacts[c];
  const double force = contact.gap <= kTouchGap ? multiplier : 0.0;
  result.multipliers[c] = force;
  const Vector3 f = force * contact.n_W;
  result.F_Ao_W += {f, (contact.p_WP - job.poseA(job.pairs[pair]).translation()).cross(f)};
}

}  // namespace tenon::collision
