#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "server/collision/island_solver.h"
#include "tests/support/analytic_structures.h"

namespace tenon::bench {

/// A box of about 1,100 points held by a hand, against one static object.
///
/// Threads: one at a time. Real-time: step.
class HeldBox {
 public:
  static constexpr double kStiffness = 1000.0;  // [N/m]
  /// [m] The smallest dilation that keeps a sheet without thickness solid, for `voxel` [m].
  static constexpr double dilationOf(double voxel) { return 0.87 * voxel; }
  static Vector3 size() { return {0.08, 0.06, 0.04}; }

  /// `dilation` [m] of the other object.
  HeldBox(collision::ContactMethod method, const test::StructuresPtr& other, double dilation,
          const Pose& X_WB)
      : other_(test::dilated(other, dilation)) {
    limits_.method = method;
    bodies_[0].X_WB = X_WB;
    bodies_[0].radius = box().shell.radius();
    bodies_[0].springs.push_back({X_WB, Vector3::Zero(), kStiffness, 20.0});
    pairs_[0].body_a = 0;
    pairs_[0].shell_A = &box().shell;
    pairs_[0].field_B = &other_->field;
    pairs_[0].last = &results_[0];
    results_[0].multipliers.resize(collision::kMaxPairContacts);
  }

  static const structures::HapticStructures& box() {
    static const test::StructuresPtr structures = test::boxStructures(size(), 0.002, 0.004);
    return *structures;
  }

  /// One tick with the hand at X_WH.
  void step(const Pose& X_WH) {
    bodies_[0].springs[0].X_WG = X_WH;
    solver_.solve(bodies_, pairs_, limits_, results_);
    overlap_ = std::max(overlap_, -results_[0].query.smallest_gap);
  }
  [[nodiscard]] const Pose& pose() const { return bodies_[0].X_WB; }
  /// [m] Largest penetration of the dilated surface in all ticks.
  [[nodiscard]] double overlap() const { return overlap_; }
  /// [N] Force on the hand, in W: the penalty sum for kPenalty, else that of its virtual coupling.
  [[nodiscard]] Vector3 force() const {
    if (limits_.method == collision::ContactMethod::kPenalty) return results_[0].F_Ao_W.force;
    return -collision::springWrench(bodies_[0].springs[0], pose()).force;
  }

 private:
  test::StructuresPtr other_;
  collision::SolveLimits limits_;
  std::array<collision::MovableBody, 1> bodies_;
  std::array<collision::IslandPair, 1> pairs_;
  std::array<collision::IslandPairResult, 1> results_;
  collision::IslandSolver solver_{1, 1};
  double overlap_ = 0.0;  ///< [m]
};

}  // namespace tenon::bench
