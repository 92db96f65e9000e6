#include <algorithm>
#include <limits>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// [m] A border of cells is looked for so far about a point: what is left to go when a body has arrived.
constexpr double kKinkReach = 2.0 * kSettled;

/// A normal that turns by more than this [rad] within that does so at a border; the slope behind must be one.
constexpr double kKinkTurn = 0.02;
constexpr double kKinkSlope = 0.3;

/// [m] The surface behind a border may be so much deeper than the contact, which is no depth.
constexpr double kKinkNoise = 1e-6;

}  // namespace

bool IslandSolver::findKink(const Job& job, std::size_t pair, std::size_t c, std::size_t row) {
  const IslandPair& one = job.pairs[pair];
  const Contact& contact = job.results[pair].query.contacts[c];
  const Pose& X_WB = job.poseB(one);
  Kink kink{pair, c, row, {}};
  for (const Vector3& t_W : tangentsOf(contact.n_W)) {
    for (const double way : {kKinkReach, -kKinkReach}) {
      const FieldSample sample = one.field_B->sample(X_WB.inverse() * (contact.p_WP + way * t_W));
      const double slope = sample.gradient.norm();
      if (!sample.exact || slope < kKinkSlope) continue;
      const Vector3 gradient_W = X_WB.rotation() * sample.gradient;
      const Vector3 n_W = gradient_W / slope;
      // a hollow holds with both its sides
      if (way * (n_W - contact.n_W).dot(t_W) < kKinkTurn * kKinkReach) continue;
      const double gap = sample.distance - one.dilation - way * gradient_W.dot(t_W);
      if (gap >= std::min(contact.gap, 0.0) - kKinkNoise) kink.sides.push_back({n_W, gap});
    }
  }
  return !kink.sides.empty() && kinks_.push_back(kink);
}

bool IslandSolver::passKinks(const Job& job, SolveReport& report) {
  kinks_.clear();
  std::size_t pair = 0;
  std::size_t first = 0;
  for (const std::uint32_t row : held_) {
    if (row >= listed_) break;
    while (row >= first + job.results[pair].query.contacts.size()) {
      first += job.results[pair++].query.contacts.size();
    }
    findKink(job, pair, row - first, row);
  }
  if (kinks_.empty()) return false;
  // where would all go if these did not hold?
  FixedVector<std::uint32_t, kMaxKinks> left_out;
  for (const Kink& kink : kinks_) left_out.push_back(static_cast<std::uint32_t>(kink.row));
  const std::span<Displacement> motions(free_motions_.data(), job.bodies.size());
  report.iterations +=
      motion_.solve(job.bodies, rows_, motions, {}, held_, rows_.size(), {left_out.begin(), left_out.size()})
          .iterations;
  const std::span<const std::uint32_t> free_held = motion_.held();
  // there the side holds that is farthest out
  bool passed = false;
  for (const Kink& kink : kinks_) {
    Contact& contact = job.results[kink.pair].query.contacts[kink.contact];
    const Vector3 motion_W = relativeMotion(job, motions, job.pairs[kink.pair], contact.p_WP);
    double farthest = contact.gap + contact.n_W.dot(motion_W);
    for (const Kink::Side& side : kink.sides) {
      const double slack = side.gap + side.n_W.dot(motion_W);
      if (slack <= farthest) continue;
      farthest = slack;
      contact.n_W = side.n_W;
      contact.gap = side.gap;
      passed = true;
    }
    rows_[kink.row].n_W = contact.n_W;
    rows_[kink.row].gap = contact.gap;
  }
  if (!passed) return false;
  held_.assign(free_held.begin(), free_held.end());
  std::sort(held_.begin(), held_.end());
  solveMotions(job, report, kinks_[0].row);
  return true;
}

Vector3 IslandSolver::relativeMotion(const Job& job, std::span<const Displacement> motions,
                                     const IslandPair& pair, const Vector3& p_WP) {
  Vector3 motion_W = Vector3::Zero();
  for (const auto& [index, sign] : {std::pair{pair.body_a, 1.0}, std::pair{pair.body_b, -1.0}}) {
    if (index == GapRow::kStatic) continue;
    const auto i = static_cast<std::size_t>(index);
    motion_W += sign * pointMotion(motions[i], p_WP - job.bodies[i].X_WB.translation());
  }
  return motion_W;
}

}  // namespace tenon
