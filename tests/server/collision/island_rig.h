#pragma once

#include <algorithm>
#include <vector>

#include "server/collision/island_solver.h"
#include "tests/support/analytic_structures.h"

namespace tenon::test {

/// One island and the hands that hold its bodies, moved tick by tick: the stage of the island tests.
class IslandRig {
 public:
  std::size_t addBody(const StructuresPtr& structures, const Pose& X_WB, double stiffness = 1000.0,
                      double rotational_stiffness = 20.0) {
    MovableBody body;
    body.X_WB = X_WB;
    body.radius = structures->shell.radius();
    body.springs.push_back({X_WB, Vector3::Zero(), stiffness, rotational_stiffness});
    bodies_.push_back(body);
    structures_.push_back(structures);
    return bodies_.size() - 1;
  }
  /// The body's shell against something that stands still.
  void addStatic(std::size_t body, const StructuresPtr& other, const Pose& X_WB, double dilation) {
    statics_.push_back(other);
    IslandPair pair;
    pair.body_a = static_cast<std::int32_t>(body);
    pair.shell_A = &structures_[body]->shell;
    pair.field_B = &other->field;
    pair.X_WB_static = X_WB;
    pair.dilation = dilation;
    push(pair);
  }
  /// The shell of something that stands still against the body: what its points are too far apart to feel.
  void addStaticShell(std::size_t body, const StructuresPtr& other, const Pose& X_WA, double dilation) {
    statics_.push_back(other);
    IslandPair pair;
    pair.body_b = static_cast<std::int32_t>(body);
    pair.shell_A = &other->shell;
    pair.field_B = &structures_[body]->field;
    pair.X_WA_static = X_WA;
    pair.dilation = dilation;
    push(pair);
  }
  void addPair(std::size_t a, std::size_t b, double dilation) {
    IslandPair pair;
    pair.body_a = static_cast<std::int32_t>(a);
    pair.body_b = static_cast<std::int32_t>(b);
    pair.shell_A = &structures_[a]->shell;
    pair.field_B = &structures_[b]->field;
    pair.dilation = dilation;
    push(pair);
  }

  void setFriction(std::size_t pair, double at_rest, double sliding) {
    pairs_[pair].friction = {at_rest, sliding};
  }
  /// The hand holds the body there instead of at its origin.
  void holdAt(std::size_t body, const Vector3& p_BC) { bodies_[body].springs[0].p_BC = p_BC; }
  void setHand(std::size_t body, const Pose& X_WH) { bodies_[body].springs[0].X_WG = X_WH; }
  /// The hand goes evenly from where it is, a step a tick.
  void moveHand(std::size_t body, const Pose& X_WH, int ticks) {
    const Pose from = bodies_[body].springs[0].X_WG;
    const Displacement way = displacement(from, X_WH);
    for (int tick = 1; tick <= ticks; ++tick) {
      const double share = static_cast<double>(tick) / ticks;
      setHand(body, displaced(from, {share * way.translation, share * way.rotation}));
      step();
    }
    setHand(body, X_WH);
  }
  void settle(int ticks) {
    for (int tick = 0; tick < ticks; ++tick) step();
  }
  SolveReport step() {
    for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].last = &results[i];
    const SolveReport report = solver_.solve(bodies_, pairs_, limits, results);
    for (const IslandPairResult& result : results) {
      deepest_overlap = std::min(deepest_overlap, result.query.smallest_gap);
    }
    conflicts += report.conflicting ? 1 : 0;
    return report;
  }

  [[nodiscard]] const MovableBody& body(std::size_t i) const { return bodies_[i]; }
  [[nodiscard]] const Pose& pose(std::size_t i) const { return bodies_[i].X_WB; }
  [[nodiscard]] const Pointshell& shell(std::size_t i) const { return structures_[i]->shell; }
  [[nodiscard]] const Wrench& force(std::size_t pair) const { return results[pair].F_Ao_W; }

  SolveLimits limits;
  std::vector<IslandPairResult> results;
  double deepest_overlap = 0.0;  ///< [m] the smallest gap at the end of any tick, 0 when none was negative
  int conflicts = 0;             ///< ticks that ended in one

 private:
  void push(const IslandPair& pair) {
    pairs_.push_back(pair);
    results.emplace_back();  // steps begin when all are there
    results.back().multipliers.resize(kMaxPairContacts);
  }

  std::vector<MovableBody> bodies_;
  std::vector<StructuresPtr> structures_;
  std::vector<StructuresPtr> statics_;
  std::vector<IslandPair> pairs_;
  IslandSolver solver_{4, 8};
};

}  // namespace tenon::test
