#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "server/collision/island_solver.h"
#include "server/simulation/contact_rooms.h"
#include "server/simulation/scene.h"
#include "server/simulation/work_limits.h"

namespace tenon {

/// What the simulation knows about two objects that may touch (paper §3.2, ii): whether the pair is on, when
/// it has to be looked at again, and what the last look found.
///
/// Spatio-temporal coherence: no point of either object travels faster than the enforced cap, so a pair with
/// a smallest gap g has nothing to say for g / (v_a + v_b). When that is over, the way that the two have
/// really gone since often puts it off again. A declared jump ends all that at once.
///
/// When a look at all levels of the shell costs more than its share of a tick, or its load is critical, the
/// pair leaves out the finest levels (graceful degradation). A level comes back after the budget had room for
/// it for a while, and later each time that this was too early: so levels do not flutter.
///
/// Its contacts are in a room of ContactRooms, which it has for the tick of a look, and as long as it lists
/// any.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class CollPair {
 public:
  using TouchingPoints = FixedVector<std::uint32_t, 64>;

  static constexpr Tick kNever = std::numeric_limits<Tick>::max();

  CollPair(const Scene& scene, std::size_t pair);

  [[nodiscard]] const PairSpec& spec() const { return *spec_; }
  [[nodiscard]] bool enabled() const { return enabled_; }
  /// False for objects without structures: they never touch, whatever the matrix says.
  [[nodiscard]] bool possible() const { return possible_; }
  [[nodiscard]] bool due(Tick tick) const { return due_ <= tick; }
  [[nodiscard]] Tick dueTick() const { return due_; }

  // of the last look since the last jump
  [[nodiscard]] bool looked() const { return looked_; }
  [[nodiscard]] double gap() const { return gap_; }          ///< [m] the smallest, dilation included
  [[nodiscard]] double deepest() const { return deepest_; }  ///< [m] in the undilated field
  [[nodiscard]] const QueryCounts& counts() const { return counts_; }
  /// Finest levels of the shell that the last look left out.
  [[nodiscard]] std::uint32_t leftOut() const { return allLevels() - std::min(allLevels(), levels_used_); }
  /// [%] What the last look would have cost with all levels, of their points as many as of those it used.
  [[nodiscard]] double wholeLoad() const noexcept;
  /// So many may be used by the next one.
  [[nodiscard]] std::uint32_t levels() const { return levels_; }
  /// Null when it listed no contacts.
  [[nodiscard]] const IslandPairResult* result() const { return lists() ? room_ : nullptr; }
  [[nodiscard]] bool lists() const { return looked_ && room_ != nullptr && !room_->query.contacts.empty(); }
  [[nodiscard]] bool touching() const noexcept { return lists() && gap_ <= kTouchGap; }
  /// What an island's solver found in the tick before `now`; null when none did. Of a pair whose bodies
  /// rested there may be older results, which depend on whether it was looked at meanwhile.
  [[nodiscard]] const IslandPairResult* solvedBefore(Tick now) const {
    return lists() && solved_ + 1 == now ? room_ : nullptr;
  }

  [[nodiscard]] bool hasRoom() const { return room_ != nullptr; }
  void moveIn(IslandPairResult* room) noexcept { room_ = room; }
  [[nodiscard]] IslandPairResult* moveOut() noexcept { return std::exchange(room_, nullptr); }

  void setEnabled(bool enabled) noexcept;
  /// What was found holds no longer; look again in the next tick.
  void forget() noexcept;
  /// What was found holds, but something may move differently from now on.
  void lookAgain() noexcept { due_ = 0; }

  // these need a room
  /// A look by itself, for pairs that no solver moves; lists contacts up to `margin`, testing up to `budget`
  /// points, `first` of them whatever is left out.
  void query(const Pose& X_WA, const Pose& X_WB, double margin, std::uint32_t budget = 0xFFFFFFFFU,
             std::span<const std::uint32_t> first = {}) noexcept;
  /// The penalty force of what query() found: the softer of the two gives way.
  void press(double stiffness, const Pose& X_WA) noexcept;
  /// Takes over what a solver found in `now`.
  void take(const IslandPairResult& result, Tick now) noexcept;

  /// Points that held or touched in the last look, those with a force first.
  void listTouching(TouchingPoints& points) const noexcept;
  /// Chooses the levels for the next look, after one with `budget` points for a walk.
  void adapt(const WorkLimits& limits, std::uint32_t budget) noexcept;

  /// Sets when to look again, once the pair was looked at in `now`: while the fastest points approach each
  /// other by at most `closing_speed` [m/s], the gap stays above `reach` [m]. `travelled`: what the
  /// odometers of both say now [m].
  void schedule(Tick now, double closing_speed, double reach, double travelled) noexcept;
  /// The same before the motion of `now`, without a look, from the way really gone. False, and no change,
  /// when that does not spare the look.
  [[nodiscard]] bool putOff(Tick now, double closing_speed, double reach, double travelled) noexcept;

  /// The pair as the island solver of `now` wants it, both bodies static.
  [[nodiscard]] IslandPair islandPair(const Pose& X_WA, const Pose& X_WB, Tick now) const noexcept;

  /// Every member that changes but the switch, to be written, read or hashed. What is read takes a room.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self, ContactRooms& rooms) {
    archive(self.looked_);
    archive(self.due_);
    archive(self.solved_);
    archive(self.travelled_);
    archive(self.gap_);
    archive(self.deepest_);
    archive(self.counts_);
    archive(self.left_out_);
    archive(self.levels_);
    if constexpr (Archive::kReads) {
      if (self.levels_ == 0) return archive.refuse();
    }
    archive(self.levels_used_);
    archive(self.walk_points_);
    archive(self.calm_);
    archive(self.patience_);
    if constexpr (Archive::kReads) {
      if (!std::isfinite(self.travelled_ + self.gap_ + self.deepest_ + self.left_out_))
        return archive.refuse();
    }
    bool lists = self.lists();
    archive(lists);
    if (!lists) return;
    if constexpr (Archive::kReads) {
      if (!self.hasRoom()) self.moveIn(rooms.take());
      if (!self.hasRoom()) return archive.refuse();
    }
    archive(*self.room_);
    if constexpr (Archive::kReads) {
      if (!self.isSound(*self.room_)) return archive.refuse();
      self.room_->query.counts = self.counts_;
      self.room_->query.smallest_gap = self.gap_;
      self.room_->query.deepest = self.deepest_;
      self.room_->query.left_out = self.left_out_;
      self.room_->query.levels_used = self.levels_used_;
      self.room_->query.walk_points = self.walk_points_;
    }
  }

 private:
  static constexpr std::uint32_t kAllLevels = 0xFFFFFFFFU;

  [[nodiscard]] std::uint32_t allLevels() const {
    return possible_ ? static_cast<std::uint32_t>(shell_A_->levels().size()) : 0;
  }
  /// Points of the shell's first `levels` levels.
  [[nodiscard]] double pointsOf(std::uint32_t levels) const noexcept;
  [[nodiscard]] bool nextLevelFits(const WorkLimits& limits, std::uint32_t budget) const noexcept;
  void note(const PairQueryResult& query) noexcept;
  /// A list that was read, before its numbers are used as places.
  [[nodiscard]] bool isSound(const IslandPairResult& room) const noexcept;
  [[nodiscard]] static Tick wholeTicks(double way, double closing_speed) noexcept;

  const PairSpec* spec_;
  const Pointshell* shell_A_ = nullptr;
  const DistanceField* field_B_ = nullptr;
  bool possible_ = false;
  bool enabled_ = true;
  bool looked_ = false;
  Tick due_ = 0;
  Tick solved_ = 0;  ///< by an island's solver, last
  double travelled_ = 0.0;
  double gap_ = 0.0;
  double deepest_ = 0.0;
  QueryCounts counts_;
  double left_out_ = 0.0;  ///< [m] points of levels left out may be nearer by so much
  std::uint32_t levels_ = kAllLevels;
  std::uint32_t levels_used_ = kAllLevels;
  std::uint32_t walk_points_ = 0;  ///< of the last look's last walk
  std::uint32_t calm_ = 0;         ///< looks in a row with room for one level more
  std::uint32_t patience_ = 0;     ///< so many are needed
  IslandPairResult* room_ = nullptr;
};

}  // namespace tenon
