#include <algorithm>
#include <utility>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [steps] A traversal lists contacts for so many full steps ahead: a usual tick needs no second one.
constexpr double kTraversalSteps = 2.0;

/// [m] Depth error by rotation, between points of a reduced list, above which the pair is traversed again.
constexpr double kReducedListError = 1e-5;

/// [m] Largest distance between those points.
constexpr double kReducedListSpacing = 0.03;

/// [-] A full list shortens a step no further than to this fraction of max_step_length: a plate on a floor,
/// which fills its list, still has to slide.
constexpr double kMinValidity = 0.25;

/// [-] A list that is full of features is traversed again when less than this fraction of its validity is
/// left.
constexpr double kUsedUp = 0.5;

/// [points of a traversal] that take as long as to evaluate a listed contact, or to test two pieces of edges.
constexpr std::uint64_t kResampledWork = 4;
constexpr std::uint64_t kPieceWork = 2;

int movableBodies(const IslandPair& pair) {
  return (pair.body_a != ContactConstraint::kStatic ? 1 : 0) +
         (pair.body_b != ContactConstraint::kStatic ? 1 : 0);
}

/// [m] Contacts up to this gap must be listed before a step: those it may reach, and contact_margin.
double neededMargin(const IslandPair& pair, const SolveLimits& limits) {
  return std::max(limits.contact_margin, pair.slope() * movableBodies(pair) * limits.max_step_length);
}

}  // namespace

void IslandSolver::queryPairs(const Job& job, double margin, SolveReport& report) {
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    queryPair(job.queryOf(job.pairs[i], margin), job.results[i].query);
    job.results[i].traversal = TraversalState{};
    job.results[i].secondary_planes = 0;
    job.results[i].slides = false;
    ++report.traversals;
    report.points_visited += job.results[i].query.counts.points_visited;
  }
}

void IslandSolver::warmStart(const Job& job) {
  active_.clear();
  std::size_t rows = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    IslandPairResult& result = job.results[i];
    const IslandPairResult* last = pair.last;
    const bool slid = last != nullptr && last->slides;
    // a static body may have been moved between solves
    if (last == nullptr || !last->traversal.valid || last->traversal.levels != pair.levels ||
        (pair.body_a == ContactConstraint::kStatic && !(last->traversal.X_WA == pair.X_WA_static)) ||
        (pair.body_b == ContactConstraint::kStatic && !(last->traversal.X_WB == pair.X_WB_static))) {
      result.query.contacts.clear();
      result.traversal = TraversalState{};
    } else {
      if (last != &result) result = *last;
      result.query.contacts.resize(result.query.contacts.size() - result.secondary_planes);
    }
    result.slid_before = slid;
    result.slides = false;
    for (std::size_t c = 0; c < result.query.contacts.size(); ++c, ++rows) {
      multipliers_[rows] = result.multipliers[c];
      // the last solve may have had more bodies
      const bool fits = active_.size() < active_.capacity();
      if (multipliers_[rows] > 0.0 && fits) active_.push_back(static_cast<std::uint32_t>(rows));
    }
  }
}

void IslandSolver::updateContacts(const Job& job, SolveReport& report) {
  // active rows of unchanged lists stay active, under their new numbers
  carried_.clear();
  std::size_t next = 0;
  std::size_t first_before = 0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const std::size_t listed = job.results[i].query.contacts.size();
    const bool same = updatePair(job, i, report);
    for (; next < active_.size() && active_[next] < first_before + listed; ++next) {
      if (same) carried_.emplace_back(active_[next] - first_before + first, multipliers_[active_[next]]);
    }
    first_before += listed;
    first += job.results[i].query.contacts.size();
  }
  active_.clear();
  for (const auto& [row, force] : carried_) {
    active_.push_back(static_cast<std::uint32_t>(row));
    multipliers_[row] = force;
  }
}

bool IslandSolver::updatePair(const Job& job, std::size_t i, SolveReport& report) {
  const double approach = job.results[i].traversal.valid ? approachSinceTraversal(job, i) : 0.0;
  if (mustTraverse(job, i, approach)) {
    traversePair(job, i, report);
    return false;
  }
  PairQueryResult& result = job.results[i].query;
  const std::size_t listed = result.contacts.size();
  resampleFeatures(job.queryOf(job.pairs[i], 0.0), job.pairs[i].features, approach, result);
  ++report.resamplings;
  report.points_visited += listed;
  report.work += kResampledWork * listed;
  return result.contacts.size() == listed;
}

void IslandSolver::traversePair(const Job& job, std::size_t i, SolveReport& report) {
  const IslandPair& pair = job.pairs[i];
  PairQuery query = job.queryOf(pair, neededMargin(pair, job.limits) + kTraversalSteps * pair.slope() *
                                                                           movableBodies(pair) *
                                                                           job.limits.max_step_length);
  query.levels = std::min(pair.levels, job.results[i].traversal.levels_used);
  query.reduce = true;
  queryPair(query, job.results[i].query);
  const PairQueryResult& found = job.results[i].query;
  feature_scratch_.pieces_tested = 0;
  queryFeatures(query, pair.features, feature_scratch_, job.results[i].query);
  job.results[i].traversal = {true,        query.X_WA,
                              query.X_WB,  found.smallest_gap - found.skipped_gap_error,
                              pair.levels, found.levels_used};
  ++report.traversals;
  report.points_visited += job.results[i].query.counts.points_visited;
  report.work += job.results[i].query.counts.points_visited + kPieceWork * feature_scratch_.pieces_tested;
}

double IslandSolver::approachSinceTraversal(const Job& job, std::size_t i) {
  const IslandPair& pair = job.pairs[i];
  double sum = 0.0;
  const auto add = [&](std::int32_t body, const Pose& X_WB_traversal) {
    if (body == ContactConstraint::kStatic) return;
    const MovableBody& now = job.bodies[static_cast<std::size_t>(body)];
    const Displacement moved = displacement(X_WB_traversal, now.X_WB, now.p_BQ);
    sum += maxPointMotion(moved, now.radius);
  };
  add(pair.body_a, job.results[i].traversal.X_WA);
  add(pair.body_b, job.results[i].traversal.X_WB);
  return pair.slope() * sum;
}

double IslandSolver::clearanceOf(const Job& job, std::size_t i) {
  const IslandPair& pair = job.pairs[i];
  const PairQueryResult& query = job.results[i].query;
  double clearance = std::min(query.smallest_gap - query.skipped_gap_error, query.dormant_gap);
  // points that the list skipped in favour of neighbours are not in its gaps after a motion
  if (query.reduced && clearance > 0.0)
    clearance = std::min(clearance, job.results[i].traversal.smallest_gap - approachSinceTraversal(job, i));
  return std::max(clearance, 0.0) / pair.slope();
}

bool IslandSolver::mustTraverse(const Job& job, std::size_t i, double approach) {
  const TraversalState& traversal = job.results[i].traversal;
  if (!traversal.valid) return true;
  const IslandPair& pair = job.pairs[i];
  const PairQueryResult& result = job.results[i].query;
  // without a displacement since, a traversal would give the same list; one that was full is used longer
  const double margin = neededMargin(pair, job.limits);
  const bool is_full = pair.features.any() && result.reduced && result.complete_to < margin;
  const double needed = is_full ? kUsedUp * result.complete_to : margin;
  if (approach > 0.0 && result.unlisted_gap - approach < needed) return true;
  if (!result.reduced) return false;
  const Quaternion turn = (job.poseB(pair).rotation().conjugate() * job.poseA(pair).rotation()) *
                          (traversal.X_WB.rotation().conjugate() * traversal.X_WA.rotation()).conjugate();
  return 2.0 * turn.vec().norm() * kReducedListSpacing > kReducedListError;
}

void IslandSolver::buildConstraints(const Job& job) {
  rows_.clear();
  for (std::size_t i = 0; i < job.pairs.size(); ++i) {
    const IslandPair& pair = job.pairs[i];
    for (const Contact& contact : job.results[i].query.contacts) {
      rows_.push_back({pair.body_a, pair.body_b, contact.n_W, contact.p_WP, contact.gap});
    }
  }
  contact_row_count_ = rows_.size();
  std::fill_n(inside_cell_.begin(), contact_row_count_, std::uint8_t{0});
  std::fill_n(released_.begin(), contact_row_count_, std::uint8_t{0});
}

std::size_t IslandSolver::pairOfRow(const Job& job, std::size_t row) {
  std::size_t i = 0;
  for (std::size_t end = job.results[0].query.contacts.size(); row >= end;) {
    end += job.results[++i].query.contacts.size();
  }
  return i;
}

double IslandSolver::validityRadius(const Job& job) {
  double radius = job.limits.max_step_length;
  for (std::size_t i = 0; i < job.results.size(); ++i) {
    const double complete_to = job.results[i].query.complete_to;
    if (complete_to < radius) radius = std::min(radius, complete_to - approachSinceTraversal(job, i));
  }
  return std::max(radius, kMinValidity * job.limits.max_step_length);
}

}  // namespace tenon::collision
