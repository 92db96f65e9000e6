#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "server/collision/island_solver.h"
#include "server/simulation/contact_list_pool.h"
#include "server/simulation/scene.h"
#include "server/simulation/work_limits.h"

namespace tenon::simulation {

/// What the second direction of a pair asks; nothing where an object has no structures.
[[nodiscard]] collision::PairFeatures featuresOf(const Scene& scene, const PairSpec& pair);

/// The state of a collision pair (paper §3.2, ii): enabled or not, the tick of its next query, and the result
/// of the last one.
///
/// Spatio-temporal coherence: no point of either object moves faster than its enforced speed cap, so a pair
/// with smallest gap g cannot be in contact for g / (v_a + v_b). At the end of that time the path that the
/// two have actually moved, and how far their hands can take them in this tick, usually allow postponing the
/// query again. A discontinuous pose change resets the pair.
///
/// When a query of all shell levels exceeds the pair's point budget, or its load is critical, the finest
/// levels are skipped (graceful degradation). A level is restored after the budget has had headroom for it
/// during a delay, which doubles each time a restored level had to be skipped again (hysteresis).
///
/// The contacts are in a list of the ContactListPool; the pair holds one in the tick of a query and for as
/// long as there are contacts.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class CollPair {
 public:
  using TouchingPoints = FixedVector<std::uint32_t, 64>;

  static constexpr Tick kNever = std::numeric_limits<Tick>::max();

  CollPair(const Scene& scene, std::size_t pair);

  [[nodiscard]] const PairSpec& spec() const { return *spec_; }
  [[nodiscard]] bool enabled() const { return enabled_; }
  /// False when an object lacks a shell or field: such a pair never collides, enabled or not.
  [[nodiscard]] bool possible() const { return possible_; }
  [[nodiscard]] bool due(Tick tick) const { return due_ <= tick; }
  [[nodiscard]] Tick dueTick() const { return due_; }

  // results of the last query since the last reset
  [[nodiscard]] bool queried() const { return queried_; }
  [[nodiscard]] double gap() const { return gap_; }      ///< [m] smallest signed gap, dilation included
  [[nodiscard]] double depth() const { return depth_; }  ///< [m] penetration depth in the field of b
  [[nodiscard]] const collision::QueryCounts& counts() const { return counts_; }
  /// Number of finest shell levels that the last query skipped.
  [[nodiscard]] std::uint32_t skippedLevels() const {
    return allLevels() - std::min(allLevels(), levels_used_);
  }
  /// [%] load of the last query, extrapolated to all shell levels by their numbers of points.
  [[nodiscard]] double loadAtAllLevels() const noexcept;
  /// Number of shell levels that the next query may use.
  [[nodiscard]] std::uint32_t levels() const { return levels_; }
  /// Null when there are no contacts.
  [[nodiscard]] const collision::IslandPairResult* result() const { return hasContacts() ? list_ : nullptr; }
  [[nodiscard]] bool hasContacts() const {
    return queried_ && list_ != nullptr && !list_->query.contacts.empty();
  }
  [[nodiscard]] bool touching() const noexcept { return hasContacts() && gap_ <= collision::kTouchGap; }
  /// The result of an island solve in the tick before `now`, else null. Older results are not used: they
  /// depend on which ticks coherence skipped.
  [[nodiscard]] const collision::IslandPairResult* solvedBefore(Tick now) const {
    return hasContacts() && solved_ + 1 == now ? list_ : nullptr;
  }

  [[nodiscard]] bool hasList() const { return list_ != nullptr; }
  void attachList(collision::IslandPairResult* list) noexcept { list_ = list; }
  [[nodiscard]] collision::IslandPairResult* detachList() noexcept { return std::exchange(list_, nullptr); }

  void setEnabled(bool enabled) noexcept;
  /// Drops all results; the pair is due in the next tick.
  void reset() noexcept;
  /// Cancels the skipping by coherence: the pair is due in the next tick. Results stay.
  void invalidate() noexcept { due_ = 0; }

  // the following functions need a contact list
  /// Queries a pair that is in no island: lists contacts with gaps up to `margin` [m], testing at most
  /// `budget` points. The `priority_points` are tested even when their level is skipped.
  void query(const Pose& X_WA, const Pose& X_WB, double margin, collision::FeatureScratch& scratch,
             std::uint32_t budget = 0xFFFFFFFFU,
             std::span<const std::uint32_t> priority_points = {}) noexcept;
  /// Sets the contact wrench to the penalty force at `stiffness` [N/m] of the contacts of query().
  void computePenaltyForce(double stiffness, const Pose& X_WA) noexcept;
  /// Copies the result of the island solver of tick `now`.
  void storeSolved(const collision::IslandPairResult& result, Tick now) noexcept;

  /// Shell points in contact at the last query: those with a contact force first, then those within
  /// kTouchGap.
  void listTouching(TouchingPoints& points) const noexcept;
  /// Chooses the levels of the next query after one that had `budget` points per traversal.
  void adaptLevels(const WorkLimits& limits, std::uint32_t budget) noexcept;

  /// Sets the due tick after a query in tick `now`: as long as points approach each other by at most
  /// `closing_speed` [m/s], the gap stays above `margin` [m] until then. `path_length` [m]: sum of the
  /// accumulated path lengths of both objects.
  void schedule(Tick now, double closing_speed, double margin, double path_length) noexcept;
  /// Moves the due tick before the motion of tick `now` without a query, from the path moved since the last
  /// one; `closing_speed` [m/s], `margin` [m] and `path_length` [m] as in schedule(). In this tick the
  /// objects approach each other by at most `reach` [m]. False, and no change, when the pair has to be
  /// queried in this tick.
  [[nodiscard]] bool postpone(Tick now, double closing_speed, double margin, double path_length,
                              double reach = std::numeric_limits<double>::infinity()) noexcept;

  /// Input of the island solver of tick `now`, with both bodies static.
  [[nodiscard]] collision::IslandPair islandPair(const Pose& X_WA, const Pose& X_WB, Tick now) const noexcept;

  /// Asks for the gap alone, for poses of this tick's start: by how much [m] the bodies may approach each
  /// other before a point or feature touches; up to `limit` [m] as near as the fields know it, beyond that a
  /// lower bound. Changes nothing else but `found`, where the work is counted.
  [[nodiscard]] double findGap(const Pose& X_WA, const Pose& X_WB, double limit,
                               collision::PairQueryResult& found,
                               collision::FeatureScratch& scratch) const noexcept;

  /// How deep [m] points of a are in b at these poses; 0 when none is. Changes nothing else but `found`.
  [[nodiscard]] double findDepth(const Pose& X_WA, const Pose& X_WB,
                                 collision::PairQueryResult& found) const noexcept;

  /// Writes, reads or hashes every member that changes except `enabled`. Reading contacts acquires a list.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self, ContactListPool& pool) {
    archive(self.queried_);
    archive(self.due_);
    archive(self.solved_);
    archive(self.path_length_);
    archive(self.gap_);
    archive(self.depth_);
    archive(self.counts_);
    archive(self.skipped_spacing_);
    archive(self.levels_);
    if constexpr (Archive::kReads) {
      if (self.levels_ == 0) return archive.reject();
    }
    archive(self.levels_used_);
    archive(self.traversal_points_);
    archive(self.queries_with_headroom_);
    archive(self.restore_delay_);
    bool has_contacts = self.hasContacts();
    archive(has_contacts);
    if (!has_contacts) return;
    if constexpr (Archive::kReads) {
      if (!self.hasList()) self.attachList(pool.acquire());
      if (!self.hasList()) return archive.reject();
    }
    archive(*self.list_);
    if constexpr (Archive::kReads) {
      if (!self.isValid(*self.list_)) return archive.reject();
      self.list_->query.counts = self.counts_;
      self.list_->query.smallest_gap = self.gap_;
      self.list_->query.deepest = self.depth_;
      self.list_->query.skipped_gap_error = self.skipped_spacing_;
      self.list_->query.levels_used = self.levels_used_;
      self.list_->query.traversal_points = self.traversal_points_;
    }
  }

 private:
  static constexpr std::uint32_t kAllLevels = 0xFFFFFFFFU;

  [[nodiscard]] std::uint32_t allLevels() const {
    return possible_ ? static_cast<std::uint32_t>(shell_A_->levels().size()) : 0;
  }
  /// [points] of the shell's coarsest `levels` levels.
  [[nodiscard]] double pointsOf(std::uint32_t levels) const noexcept;
  [[nodiscard]] bool nextLevelFits(const WorkLimits& limits, std::uint32_t budget) const noexcept;
  void store(const collision::PairQueryResult& query) noexcept;
  /// Of gaps up to `margin` [m], without a list.
  [[nodiscard]] collision::PairQuery gapQuery(const Pose& X_WA, const Pose& X_WB,
                                              double margin) const noexcept;
  /// Validates a contact read from a checkpoint: indices in range, crossings with a piece of an edge.
  [[nodiscard]] bool isIndexValid(const collision::Contact& contact) const noexcept;
  /// Validates a list read from a checkpoint.
  [[nodiscard]] bool isValid(const collision::IslandPairResult& list) const noexcept;
  /// Whole ticks in which `distance` [m] cannot be closed at `closing_speed` [m/s].
  [[nodiscard]] static Tick ticksToClose(double distance, double closing_speed) noexcept;

  const PairSpec* spec_;
  const structures::Pointshell* shell_A_ = nullptr;
  const structures::DistanceField* field_B_ = nullptr;
  collision::PairFeatures features_;
  double slope_ = 1.0;  ///< [-] gaps change by at most this times a motion
  bool possible_ = false;
  bool enabled_ = true;
  bool queried_ = false;
  Tick due_ = 0;
  Tick solved_ = 0;           ///< tick of the last island solve
  double path_length_ = 0.0;  ///< [m] of both objects at the last query
  double gap_ = 0.0;          ///< [m]
  double depth_ = 0.0;        ///< [m]
  collision::QueryCounts counts_;
  double skipped_spacing_ = 0.0;  ///< [m] points of skipped levels may have gaps smaller than gap_ by this
  std::uint32_t levels_ = kAllLevels;
  std::uint32_t levels_used_ = kAllLevels;
  std::uint32_t traversal_points_ = 0;       ///< tested by the last traversal
  std::uint32_t queries_with_headroom_ = 0;  ///< consecutive queries with budget for one more level
  std::uint32_t restore_delay_ = 0;          ///< [queries] with headroom before a level is restored
  collision::IslandPairResult* list_ = nullptr;
};

}  // namespace tenon::simulation
