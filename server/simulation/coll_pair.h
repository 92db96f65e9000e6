#pragma once

#include <cstddef>
#include <limits>

#include "idl/types/ids.h"
#include "server/collision/island_solver.h"
#include "server/simulation/scene.h"

namespace tenon {

/// What the simulation knows about two objects that may touch (paper §3.2, ii): whether the pair is on, when
/// it has to be looked at again, and what the last look found.
///
/// Spatio-temporal coherence: no point of either object travels faster than the enforced cap, so a pair with
/// a smallest gap g has nothing to say for g / (v_a + v_b). A declared jump ends that at once.
///
/// Threads: one at a time. Real-time: everything but the constructor and copies.
class CollPair {
 public:
  static constexpr Tick kNever = std::numeric_limits<Tick>::max();

  CollPair(const Scene& scene, std::size_t pair);

  [[nodiscard]] const PairSpec& spec() const { return *spec_; }
  [[nodiscard]] bool enabled() const { return enabled_; }
  /// False for objects of one group or without structures: they never touch, whatever the matrix says.
  [[nodiscard]] bool possible() const { return possible_; }
  [[nodiscard]] bool due(Tick tick) const { return due_ <= tick; }
  [[nodiscard]] Tick dueTick() const { return due_; }
  /// Of the last look; null when there was none since the last jump.
  [[nodiscard]] const IslandPairResult* result() const { return looked_ ? &result_ : nullptr; }

  void setEnabled(bool enabled) noexcept;
  /// What was found holds no longer; look again in the next tick.
  void forget() noexcept;
  /// What was found holds, but something may move differently from now on.
  void lookAgain() noexcept { due_ = 0; }

  /// The lowest gap that is possible at `now` [m].
  [[nodiscard]] double clearance(Tick now) const noexcept;
  [[nodiscard]] bool touching() const noexcept {
    return looked_ && !result_.query.contacts.empty() && result_.query.smallest_gap <= kTouchGap;
  }

  /// A look by itself, for pairs that no solver moves; lists contacts up to `margin`.
  void query(const Pose& X_WA, const Pose& X_WB, double margin) noexcept;
  /// The penalty force of what query() found: the softer of the two gives way.
  void press(double stiffness, const Pose& X_WA) noexcept;
  /// Takes over what a solver found.
  void take(const IslandPairResult& result) noexcept;
  /// Sets when to look again, once the pair was looked at in `now`: while the fastest points approach each
  /// other by at most `closing_speed` [m/s], the gap stays above `reach` [m].
  void schedule(Tick now, double closing_speed, double reach) noexcept;

  /// The pair as the island solver wants it, both bodies static.
  [[nodiscard]] IslandPair islandPair(const Pose& X_WA, const Pose& X_WB) const noexcept;

  /// Every member that changes, to be written, read or hashed.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self) {
    archive(self.enabled_);
    archive(self.looked_);
    archive(self.due_);
    archive(self.looked_tick_);
    archive(self.closing_speed_);
    if (self.looked_) archive(self.result_);
  }

 private:
  const PairSpec* spec_;
  const Pointshell* shell_A_ = nullptr;
  const DistanceField* field_B_ = nullptr;
  bool possible_ = false;
  bool enabled_ = true;
  bool looked_ = false;
  Tick due_ = 0;
  Tick looked_tick_ = 0;
  double closing_speed_ = 0.0;
  IslandPairResult result_;
};

/// Copies as much of a list as it holds; a list has room for far more.
void copyResult(const IslandPairResult& from, IslandPairResult& to) noexcept;

}  // namespace tenon
