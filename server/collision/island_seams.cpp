#include <algorithm>
#include <limits>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [m] Cell borders are searched for within this distance of an active contact: about the convergence
/// tolerance, as a step often ends at a border.
constexpr double kSeamDistance = 2.0 * kSettleTolerance;

/// [rad] A normal that turns by more than this within that distance does so at a border.
constexpr double kSeamTurn = 0.02;

/// [-] Where the field's slope is less, the gradient gives no plane.
constexpr double kMinSeamSlope = 0.3;

/// [m] The plane beyond a border may be deeper than the contact by this: discretisation, not depth.
constexpr double kSeamDepthNoise = 1e-6;

/// [-] Normals whose dot product is nearer to 1 are equal.
constexpr double kSameNormal = 1e-9;

/// [m] A contact that holds is released to a side that has more slack than this at the end of the step.
constexpr double kReleaseSlack = 1e-6;

/// [points of a traversal] that take as long as the planes beside a contact.
constexpr std::uint64_t kBorderWork = 30;
constexpr std::uint64_t kEdgeWork = 8;

}  // namespace

IslandSolver::SeamSides IslandSolver::sidesAtEdge(const Job& job, const IslandPair& pair,
                                                  const Contact& contact) {
  SeamSides sides;
  for (const ContactSide& side : sidesOfWedge(pair.features, contact, job.poseA(pair), job.poseB(pair))) {
    const bool outside = side.gap >= std::min(contact.gap, 0.0) - kFieldNoise;
    if (outside && side.n_W.dot(contact.n_W) < 1.0 - kSameNormal) sides.push_back(side);
  }
  return sides;
}

IslandSolver::SeamSides IslandSolver::sidesAtBorder(const Job& job, const IslandPair& pair,
                                                    const Contact& contact) {
  SeamSides sides;
  const auto surface = job.surfaceOf(pair, contact);
  const Pose& X_WB = *surface.X_WF;
  const Vector3 out_W = surface.sign * contact.n_W;
  for (const Vector3& t_W : tangentsOf(contact.n_W)) {
    for (const double offset : {kSeamDistance, -kSeamDistance}) {
      const structures::FieldSample sample = surface.sample(X_WB.inverse() * (contact.p_WP + offset * t_W));
      const double slope = sample.gradient.norm();
      if (!sample.exact || slope < kMinSeamSlope) continue;
      const Vector3 gradient_W = X_WB.rotation() * sample.gradient;
      const Vector3 n_W = gradient_W / slope;
      // on a concave surface both sides hold
      if (offset * (n_W - out_W).dot(t_W) < kSeamTurn * kSeamDistance) continue;
      const double gap = sample.distance - offset * gradient_W.dot(t_W);
      if (gap >= std::min(contact.gap, 0.0) - kSeamDepthNoise) sides.push_back({surface.sign * n_W, gap});
    }
  }
  return sides;
}

void IslandSolver::addSeam(const Job& job, Seam seam, SeamKind kind, std::size_t active,
                           SolveReport& report) {
  const auto contactOf = [&job](const Seam& one) -> const Contact& {
    return job.results[one.pair].query.contacts[one.contact];
  };
  const auto nearer = [&](const Seam& one, const Seam& other) {
    return contactOf(one).gap < contactOf(other).gap;
  };
  const bool at_border = kind == SeamKind::kBorder;
  if (at_border && inside_cell_[seam.row] != 0) return;
  Seam* farthest = seams_.end();
  if (seams_.full()) {
    farthest = std::max_element(seams_.begin() + active, seams_.end(), nearer);
    if (farthest == seams_.end() || !nearer(seam, *farthest)) return;
  }
  const IslandPair& pair = job.pairs[seam.pair];
  report.work += at_border ? kBorderWork : kEdgeWork;
  seam.sides =
      at_border ? sidesAtBorder(job, pair, contactOf(seam)) : sidesAtEdge(job, pair, contactOf(seam));
  if (seam.sides.empty()) {
    if (at_border) inside_cell_[seam.row] = 1;
    return;
  }
  if (farthest != seams_.end()) {
    *farthest = seam;
  } else {
    seams_.push_back(seam);
  }
}

void IslandSolver::findSeams(const Job& job, SeamKind kind, SolveReport& report) {
  seams_.clear();
  std::size_t pair = 0;
  std::size_t first = 0;
  for (const std::uint32_t row : active_) {
    if (row >= contact_row_count_) break;
    while (row >= first + job.results[pair].query.contacts.size()) {
      first += job.results[pair++].query.contacts.size();
    }
    const bool crosses = job.results[pair].query.contacts[row - first].kind == ContactKind::kCrossing;
    if (crosses != (kind == SeamKind::kEdge)) continue;
    addSeam(job, {pair, row - first, row, {}}, kind, seams_.size(), report);
  }
  if (seams_.empty()) return;
  const std::size_t active = seams_.size();
  // along a rim the next point would hold instead
  first = 0;
  for (pair = 0; pair < job.pairs.size(); ++pair) {
    const ContactList& contacts = job.results[pair].query.contacts;
    for (std::size_t c = 0; c < contacts.size(); ++c) {
      const bool crosses = contacts[c].kind == ContactKind::kCrossing;
      if (crosses != (kind == SeamKind::kEdge) || contacts[c].gap > kTouchGap ||
          multipliers_[first + c] > 0.0)
        continue;
      addSeam(job, {pair, c, first + c, {}}, kind, active, report);
    }
    first += contacts.size();
  }
}

bool IslandSolver::relaxSeamNormals(const Job& job, SeamKind kind, SolveReport& report) {
  findSeams(job, kind, report);
  if (seams_.empty()) return false;
  // the step if the contacts at seams did not hold
  FixedVector<std::uint32_t, kMaxSeams> excluded;
  for (const Seam& seam : seams_) excluded.push_back(static_cast<std::uint32_t>(seam.row));
  const std::span<Displacement> step(step_without_seams_.data(), job.bodies.size());
  report.iterations +=
      motion_.solve(job.bodies, rows_, step, {}, active_, rows_.size(), {excluded.begin(), excluded.size()})
          .iterations;
  const std::span<const std::uint32_t> active_without_seams = motion_.activeRows();
  // outside a convex surface, free space is the union of both half-spaces: the largest slack decides
  std::size_t unchanged = rows_.size();
  for (const Seam& seam : seams_) {
    if (released_[seam.row] != 0) continue;
    if (takeSideWithSlack(job, seam, step, 0.0)) unchanged = std::min(unchanged, seam.row);
  }
  if (unchanged == rows_.size()) return releaseSeams(job, report);
  active_.assign(active_without_seams.begin(), active_without_seams.end());
  std::sort(active_.begin(), active_.end());
  solveQp(job, report, unchanged);
  return true;
}

bool IslandSolver::takeSideWithSlack(const Job& job, const Seam& seam, std::span<const Displacement> step,
                                     double least) {
  Contact& contact = job.results[seam.pair].query.contacts[seam.contact];
  const Vector3 u_W = relativeDisplacement(job, step, job.pairs[seam.pair], contact.p_WP);
  double largest_slack = contact.gap + contact.n_W.dot(u_W) + least;
  bool changed = false;
  for (const ContactSide& side : seam.sides) {
    const double slack = side.gap + side.n_W.dot(u_W);
    if (slack <= largest_slack) continue;
    largest_slack = slack;
    contact.n_W = side.n_W;
    contact.gap = side.gap;
    changed = true;
  }
  rows_[seam.row].n_W = contact.n_W;
  rows_[seam.row].gap = contact.gap;
  return changed;
}

bool IslandSolver::releaseSeams(const Job& job, SolveReport& report) {
  std::size_t unchanged = rows_.size();
  const std::span<const Displacement> step(step_.data(), job.bodies.size());
  for (const Seam& seam : seams_) {
    if (multipliers_[seam.row] <= 0.0 || !takeSideWithSlack(job, seam, step, kReleaseSlack)) continue;
    released_[seam.row] = 1;
    unchanged = std::min(unchanged, seam.row);
  }
  if (unchanged == rows_.size()) return false;
  const auto is_released = [this](std::uint32_t row) {
    return row < contact_row_count_ && released_[row] != 0;
  };
  active_.erase(std::remove_if(active_.begin(), active_.end(), is_released), active_.end());
  solveQp(job, report, unchanged);
  return true;
}

Vector3 IslandSolver::relativeDisplacement(const Job& job, std::span<const Displacement> step,
                                           const IslandPair& pair, const Vector3& p_WP) {
  Vector3 u_W = Vector3::Zero();
  for (const auto& [index, sign] : {std::pair{pair.body_a, 1.0}, std::pair{pair.body_b, -1.0}}) {
    if (index == ContactConstraint::kStatic) continue;
    const auto i = static_cast<std::size_t>(index);
    u_W += sign * pointDisplacement(step[i], p_WP - job.bodies[i].p_WQ());
  }
  return u_W;
}

}  // namespace tenon::collision
