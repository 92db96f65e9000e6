#include <algorithm>
#include <cmath>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [-] Cosine of the largest angle between the normals of one patch.
constexpr double kSamePatchCosine = 0.9;

/// [-] Loads and directions have converged when they change by less than this fraction.
constexpr double kFrictionTolerance = 1e-3;

/// After so many rounds the last loads and directions are used.
constexpr int kFrictionRounds = 8;

/// [m] A smaller tangential displacement has no direction.
constexpr double kMinSlip = 1e-10;

/// [-] Factor on the friction limit that allows for rounding.
constexpr double kLimitMargin = 1.0 + 1e-6;

}  // namespace

void IslandSolver::solveFriction(const Job& job, SolveReport& report) {
  patches_.clear();
  const bool frictional = std::any_of(job.pairs.begin(), job.pairs.end(),
                                      [](const IslandPair& pair) { return pair.friction.at_rest > 0.0; });
  if (!frictional) return;
  collectPatches(job);
  bool changed = !patches_.empty();
  for (int round = 0; changed && round < kFrictionRounds; ++round) {
    applyFriction(job);
    solveQp(job, report, first_patch_row_);
    changed = updatePatches(job);
  }
}

bool IslandSolver::collectPatches(const Job& job) {
  std::array<double, kMaxPatches> load_before{};
  for (std::size_t k = 0; k < patches_.size(); ++k) {
    load_before[k] = patches_[k].load;
    patches_[k].load = 0.0;
    patches_[k].normal_force_W = patches_[k].weighted_p_W = Vector3::Zero();
  }
  const std::size_t patches_before = patches_.size();
  first_patch_row_ = contact_row_count_ + secondary_plane_count_;
  for (const std::uint32_t row : active_) {
    if (row >= first_patch_row_) break;
    const std::size_t pair =
        row < contact_row_count_ ? pairOfRow(job, row) : secondary_planes_[row - contact_row_count_].pair;
    const ContactConstraint& contact = rows_[row];
    // a contact that the step has yet to reach has no friction
    if (job.pairs[pair].friction.at_rest <= 0.0 || contact.gap > kTouchGap) continue;
    FrictionPatch* found = std::find_if(patches_.begin(), patches_.end(), [&](const FrictionPatch& patch) {
      return patch.pair == pair && patch.n_W.dot(contact.n_W) > kSamePatchCosine;
    });
    if (found == patches_.end()) {
      FrictionPatch patch;
      patch.pair = pair;
      patch.n_W = contact.n_W;
      if (!patches_.push_back(patch)) continue;
      found = &patches_.back();
    }
    found->load += multipliers_[row];
    found->normal_force_W += multipliers_[row] * contact.n_W;
    found->weighted_p_W += multipliers_[row] * contact.p_WP;
  }
  bool changed = patches_.size() > patches_before;
  for (std::size_t k = 0; k < patches_.size(); ++k) {
    FrictionPatch& patch = patches_[k];
    changed = changed || std::abs(patch.load - load_before[k]) > kFrictionTolerance * patch.load;
    if (patch.load <= 0.0) continue;
    patch.n_W = patch.normal_force_W.normalized();
    patch.p_WP = patch.weighted_p_W / patch.load;
  }
  return changed;
}

void IslandSolver::applyFriction(const Job& job) {
  rows_.resize(first_patch_row_);
  active_.erase(std::lower_bound(active_.begin(), active_.end(), first_patch_row_), active_.end());
  for (MovableBody& body : job.bodies) body.friction_Bq_W = Wrench{};
  for (FrictionPatch& patch : patches_) {
    patch.first_row = 0;
    if (patch.load <= 0.0) continue;
    const IslandPair& pair = job.pairs[patch.pair];
    if (!patch.slides) {
      patch.first_row = rows_.size();
      for (const Vector3& t_W : tangentsOf(patch.n_W)) {
        rows_.push_back({pair.body_a, pair.body_b, t_W, patch.p_WP, 0.0});
        rows_.push_back({pair.body_a, pair.body_b, -t_W, patch.p_WP, 0.0});
      }
      continue;
    }
    const Vector3 f_A_W = pair.friction.sliding * patch.load * patch.direction_W;
    for (const auto& [index, sign] : {std::pair{pair.body_a, 1.0}, std::pair{pair.body_b, -1.0}}) {
      if (index == ContactConstraint::kStatic) continue;
      MovableBody& body = job.bodies[static_cast<std::size_t>(index)];
      const Vector3 f_W = sign * f_A_W;
      body.friction_Bq_W += {f_W, (patch.p_WP - body.p_WQ()).cross(f_W)};
    }
  }
}

Vector3 IslandSolver::frictionForce(const Job& job, const FrictionPatch& patch) const {
  if (patch.slides) return job.pairs[patch.pair].friction.sliding * patch.load * patch.direction_W;
  Vector3 sum = Vector3::Zero();
  if (patch.first_row == 0) return sum;
  for (std::size_t row = patch.first_row; row < patch.first_row + kPatchRows; ++row) {
    sum += multipliers_[row] * rows_[row].n_W;
  }
  return sum;
}

bool IslandSolver::updatePatches(const Job& job) {
  // friction forces of this solve, before collectPatches overwrites the loads
  std::array<Vector3, kMaxPatches> friction;
  const std::size_t solved = patches_.size();
  for (std::size_t k = 0; k < solved; ++k) friction[k] = frictionForce(job, patches_[k]);
  bool changed = collectPatches(job);
  for (std::size_t k = 0; k < solved; ++k) {
    FrictionPatch& patch = patches_[k];
    if (patch.load <= 0.0) continue;
    const IslandPair& pair = job.pairs[patch.pair];
    IslandPairResult& result = job.results[patch.pair];
    if (!patch.slides) {
      const bool slid = result.slid_before || result.slides;
      const double limit = (slid ? pair.friction.sliding : pair.friction.at_rest) * patch.load;
      if (patch.stuck_again || friction[k].norm() <= kLimitMargin * limit) continue;
      patch.slides = result.slides = changed = true;
      patch.direction_W = friction[k].normalized();
      continue;
    }
    Vector3 slip_W = relativeDisplacement(job, step_, pair, patch.p_WP);
    slip_W -= slip_W.dot(patch.n_W) * patch.n_W;
    const double slip = slip_W.norm();
    if (slip < kMinSlip) continue;
    const Vector3 direction_W = -slip_W / slip;
    if (direction_W.dot(patch.direction_W) < 0.0) {
      // the sliding direction reversed: friction would drive the motion, so the patch sticks
      patch.slides = false;
      patch.stuck_again = changed = true;
      continue;
    }
    changed = changed || (direction_W - patch.direction_W).norm() > kFrictionTolerance;
    patch.direction_W = direction_W;
  }
  return changed;
}

void IslandSolver::addFriction(const Job& job) const {
  for (const FrictionPatch& patch : patches_) {
    IslandPairResult& result = job.results[patch.pair];
    const Vector3 f_A_W = frictionForce(job, patch);
    result.F_Ao_W += {f_A_W, (patch.p_WP - job.poseA(job.pairs[patch.pair]).translation()).cross(f_A_W)};
  }
}

}  // namespace tenon::collision
