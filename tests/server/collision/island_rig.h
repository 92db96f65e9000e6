#pragma once

#include <algorithm>
#include <vector>

#include "server/collision/island_solver.h"
#include "tests/support/analytic_structures.h"

namespace tenon::test {

/// One contact island, with a hand on each of its bodies, solved tick by tick.
///
/// Bodies and pairs are added before the first step.
class IslandRig {
 public:
  /// A body held at its origin by a coupling of `stiffness` [N/m] and `rotational_stiffness` [Nm/rad].
  std::size_t addBody(const StructuresPtr& structures, const Pose& X_WB, double stiffness = 1000.0,
                      double rotational_stiffness = 20.0) {
    collision::MovableBody body;
    body.X_WB = X_WB;
    body.p_BQ = structures->shell.boundingCentre();
    body.radius = structures->shell.boundingRadius();
    body.springs.push_back({X_WB, Vector3::Zero(), stiffness, rotational_stiffness});
    bodies_.push_back(body);
    structures_.push_back(structures);
    return bodies_.size() - 1;
  }
  /// The body's pointshell against the SDF of a static object; `dilation` [m].
  void addStatic(std::size_t body, const StructuresPtr& other, const Pose& X_WB, double dilation) {
    statics_.push_back(dilated(other, dilation));
    collision::IslandPair pair;
    pair.body_a = static_cast<std::int32_t>(body);
    pair.shell_A = &structures_[body]->shell;
    pair.field_B = &statics_.back()->field;
    pair.X_WB_static = X_WB;
    push(pair);
  }
  /// The pointshell of a static object against the body's SDF: finds edges and vertices between the body's
  /// points. `dilation` [m].
  void addStaticShell(std::size_t body, const StructuresPtr& other, const Pose& X_WA, double dilation) {
    statics_.push_back(other);
    statics_.push_back(dilated(structures_[body], dilation));
    collision::IslandPair pair;
    pair.body_b = static_cast<std::int32_t>(body);
    pair.shell_A = &other->shell;
    pair.field_B = &statics_.back()->field;
    pair.X_WA_static = X_WA;
    push(pair);
  }
  /// Pointshell of body a against the SDF of body b; `dilation` [m].
  void addPair(std::size_t a, std::size_t b, double dilation) {
    collision::IslandPair pair;
    pair.body_a = static_cast<std::int32_t>(a);
    pair.body_b = static_cast<std::int32_t>(b);
    statics_.push_back(dilated(structures_[b], dilation));
    pair.shell_A = &structures_[a]->shell;
    pair.field_B = &statics_.back()->field;
    push(pair);
  }

  /// Coefficients `at_rest` [-] and `sliding` [-].
  void setFriction(std::size_t pair, double at_rest, double sliding) {
    pairs_[pair].friction = {at_rest, sliding};
  }
  /// The hand holds the body at p_BC instead of at its origin.
  void holdAt(std::size_t body, const Vector3& p_BC) { bodies_[body].springs[0].p_BC = p_BC; }
  void setHand(std::size_t body, const Pose& X_WH) { bodies_[body].springs[0].X_WG = X_WH; }
  /// Moves the hand to X_WH with constant velocity, and solves each tick.
  void moveHand(std::size_t body, const Pose& X_WH, int ticks) {
    const Pose from = bodies_[body].springs[0].X_WG;
    const Displacement path = displacement(from, X_WH);
    for (int tick = 1; tick <= ticks; ++tick) {
      const double fraction = static_cast<double>(tick) / ticks;
      setHand(body, displaced(from, {fraction * path.translation, fraction * path.rotation}));
      step();
    }
    setHand(body, X_WH);
  }
  void settle(int ticks) {
    for (int tick = 0; tick < ticks; ++tick) step();
  }
  collision::SolveReport step() {
    for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].last = &results[i];
    const collision::SolveReport report = solver_.solve(bodies_, pairs_, limits, results);
    for (const collision::IslandPairResult& result : results) {
      smallest_gap = std::min(smallest_gap, result.query.smallest_gap);
    }
    infeasible_ticks += report.infeasible ? 1 : 0;
    return report;
  }

  [[nodiscard]] const collision::MovableBody& body(std::size_t i) const { return bodies_[i]; }
  [[nodiscard]] const Pose& pose(std::size_t i) const { return bodies_[i].X_WB; }
  [[nodiscard]] const structures::Pointshell& shell(std::size_t i) const { return structures_[i]->shell; }
  [[nodiscard]] const Wrench& force(std::size_t pair) const { return results[pair].F_Ao_W; }

  collision::SolveLimits limits;
  std::vector<collision::IslandPairResult> results;
  double smallest_gap = 0.0;  ///< [m] at the end of any tick; 0 when none was negative
  int infeasible_ticks = 0;   ///< ticks whose last QP was infeasible

 private:
  void push(const collision::IslandPair& pair) {
    pairs_.push_back(pair);
    results.emplace_back();
    results.back().multipliers.resize(collision::kMaxPairContacts);
  }

  std::vector<collision::MovableBody> bodies_;
  std::vector<StructuresPtr> structures_;
  std::vector<StructuresPtr> statics_;  // and dilated structures of bodies
  std::vector<collision::IslandPair> pairs_;
  collision::IslandSolver solver_{4, 8};
};

}  // namespace tenon::test
