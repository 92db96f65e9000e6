#include <algorithm>
#include <cmath>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// Cosine of the angle up to which what holds a body belongs to one patch.
constexpr double kSamePatch = 0.9;

/// Loads and directions settle within this share, in so many solves at most.
constexpr double kRubTolerance = 1e-3;
constexpr int kRubRounds = 8;

/// [m] Less is no sliding.
constexpr double kNoSlide = 1e-10;

/// A limit is passed when it is passed by more than rounding.
constexpr double kBeyond = 1.0 + 1e-6;

}  // namespace

void IslandSolver::rub(const Job& job, SolveReport& report) {
  patches_.clear();
  const bool rough = std::any_of(job.pairs.begin(), job.pairs.end(),
                                 [](const IslandPair& pair) { return pair.friction.at_rest > 0.0; });
  if (!rough) return;
  loadPatches(job);
  bool changes = !patches_.empty();
  for (int round = 0; changes && round < kRubRounds; ++round) {
    setFriction(job);
    solveMotions(job, report, first_patch_row_);
    changes = judgePatches(job);
  }
}

bool IslandSolver::loadPatches(const Job& job) {
  std::array<double, kMaxPatches> before{};
  for (std::size_t k = 0; k < patches_.size(); ++k) {
    before[k] = patches_[k].load;
    patches_[k].load = 0.0;
    patches_[k].push_W = patches_[k].at_W = Vector3::Zero();
  }
  const std::size_t known = patches_.size();
  first_patch_row_ = listed_ + flank_count_;
  for (const std::uint32_t row : held_) {
    if (row >= first_patch_row_) break;
    const std::size_t pair = row < listed_ ? pairOfRow(job, row) : flanks_[row - listed_].pair;
    const GapRow& gap = rows_[row];
    // what binds only farther along the way does not rub yet
    if (job.pairs[pair].friction.at_rest <= 0.0 || gap.gap > kTouchGap) continue;
    Patch* found = std::find_if(patches_.begin(), patches_.end(), [&](const Patch& patch) {
      return patch.pair == pair && patch.n_W.dot(gap.n_W) > kSamePatch;
    });
    if (found == patches_.end()) {
      Patch patch;
      patch.pair = pair;
      patch.n_W = gap.n_W;
      if (!patches_.push_back(patch)) continue;
      found = &patches_.back();
    }
    found->load += multipliers_[row];
    found->push_W += multipliers_[row] * gap.n_W;
    found->at_W += multipliers_[row] * gap.p_WP;
  }
  bool changed = patches_.size() > known;
  for (std::size_t k = 0; k < patches_.size(); ++k) {
    Patch& patch = patches_[k];
    changed = changed || std::abs(patch.load - before[k]) > kRubTolerance * patch.load;
    if (patch.load <= 0.0) continue;
    patch.n_W = patch.push_W.normalized();
    patch.p_WP = patch.at_W / patch.load;
  }
  return changed;
}

void IslandSolver::setFriction(const Job& job) {
  rows_.resize(first_patch_row_);
  held_.erase(std::lower_bound(held_.begin(), held_.end(), first_patch_row_), held_.end());
  for (MovableBody& body : job.bodies) body.drag_Bo_W = Wrench{};
  for (Patch& patch : patches_) {
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
    const Vector3 drag_A_W = pair.friction.sliding * patch.load * patch.along_W;
    for (const auto& [index, sign] : {std::pair{pair.body_a, 1.0}, std::pair{pair.body_b, -1.0}}) {
      if (index == GapRow::kStatic) continue;
      MovableBody& body = job.bodies[static_cast<std::size_t>(index)];
      const Vector3 drag_W = sign * drag_A_W;
      body.drag_Bo_W += {drag_W, (patch.p_WP - body.X_WB.translation()).cross(drag_W)};
    }
  }
}

Vector3 IslandSolver::frictionOf(const Job& job, const Patch& patch) const {
  if (patch.slides) return job.pairs[patch.pair].friction.sliding * patch.load * patch.along_W;
  Vector3 sum = Vector3::Zero();
  if (patch.first_row == 0) return sum;
  for (std::size_t row = patch.first_row; row < patch.first_row + kPatchRows; ++row) {
    sum += multipliers_[row] * rows_[row].n_W;
  }
  return sum;
}

bool IslandSolver::judgePatches(const Job& job) {
  // what held the patches in this solve, before their loads are found again
  std::array<Vector3, kMaxPatches> friction;
  const std::size_t solved = patches_.size();
  for (std::size_t k = 0; k < solved; ++k) friction[k] = frictionOf(job, patches_[k]);
  bool changed = loadPatches(job);
  for (std::size_t k = 0; k < solved; ++k) {
    Patch& patch = patches_[k];
    if (patch.load <= 0.0) continue;
    const IslandPair& pair = job.pairs[patch.pair];
    IslandPairResult& result = job.results[patch.pair];
    if (!patch.slides) {
      const bool slid = result.slid || result.slides;
      const double limit = (slid ? pair.friction.sliding : pair.friction.at_rest) * patch.load;
      if (patch.stuck_again || friction[k].norm() <= kBeyond * limit) continue;
      patch.slides = result.slides = changed = true;
      patch.along_W = friction[k].normalized();
      continue;
    }
    Vector3 way_W = relativeMotion(job, motions_, pair, patch.p_WP);
    way_W -= way_W.dot(patch.n_W) * patch.n_W;
    const double way = way_W.norm();
    if (way < kNoSlide) continue;
    const Vector3 along_W = -way_W / way;
    if (along_W.dot(patch.along_W) < 0.0) {
      // it would be dragged along: it sticks
      patch.slides = false;
      patch.stuck_again = changed = true;
      continue;
    }
    changed = changed || (along_W - patch.along_W).norm() > kRubTolerance;
    patch.along_W = along_W;
  }
  return changed;
}

void IslandSolver::fillFriction(const Job& job) const {
  for (const Patch& patch : patches_) {
    IslandPairResult& result = job.results[patch.pair];
    const Vector3 f_A_W = frictionOf(job, patch);
    result.F_Ao_W += {f_A_W, (patch.p_WP - job.poseA(job.pairs[patch.pair]).translation()).cross(f_A_W)};
  }
}

}  // namespace tenon
