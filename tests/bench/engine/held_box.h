#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "server/collision/island_solver.h"
#include "tests/support/analytic_structures.h"

namespace tenon::bench {

/// A box of some 1,100 points on a hand, against one thing that stands still.
class HeldBox {
 public:
  static constexpr double kStiffness = 1000.0;  // [N/m]
  /// The least that keeps a sheet of no thickness solid.
  static constexpr double dilationOf(double voxel) { return 0.87 * voxel; }
  static Vector3 size() { return {0.08, 0.06, 0.04}; }

  HeldBox(ContactMethod method, test::StructuresPtr other, double dilation, const Pose& X_WB)
      : other_(std::move(other)) {
    limits_.method = method;
    bodies_[0].X_WB = X_WB;
    bodies_[0].radius = box().shell.radius();
    bodies_[0].springs.push_back({X_WB, Vector3::Zero(), kStiffness, 20.0});
    pairs_[0].body_a = 0;
    pairs_[0].shell_A = &box().shell;
    pairs_[0].field_B = &other_->field;
    pairs_[0].dilation = dilation;
    pairs_[0].last = &results_[0];
    results_[0].multipliers.resize(kMaxPairContacts);
  }

  static const HapticStructures& box() {
    static const test::StructuresPtr structures = test::boxStructures(size(), 0.002, 0.004);
    return *structures;
  }

  void step(const Pose& X_WH) {
    bodies_[0].springs[0].X_WG = X_WH;
    solver_.solve(bodies_, pairs_, limits_, results_);
    overlap_ = std::max(overlap_, -results_[0].query.smallest_gap);
  }
  [[nodiscard]] const Pose& pose() const { return bodies_[0].X_WB; }
  [[nodiscard]] double overlap() const { return overlap_; }
  /// What the hand feels: of penalties the sum, else the pull of its coupling.
  [[nodiscard]] Vector3 force() const {
    if (limits_.method == ContactMethod::kPenalty) return results_[0].F_Ao_W.force;
    return -springWrench(bodies_[0].springs[0], pose()).force;
  }

 private:
  test::StructuresPtr other_;
  SolveLimits limits_;
  std::array<MovableBody, 1> bodies_;
  std::array<IslandPair, 1> pairs_;
  std::array<IslandPairResult, 1> results_;
  IslandSolver solver_{1, 1};
  double overlap_ = 0.0;
};

}  // namespace tenon::bench
