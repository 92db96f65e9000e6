#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"

namespace tenon::simulation {

/// Partition of the movable bodies into contact islands: union-find over the pairs that may touch in this
/// tick. Immovable bodies do not connect islands: two hands that touch the same fixed part are independent.
///
/// Islands are numbered by their lowest object id, and so are bodies within an island: the same in every run.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class IslandPartition {
 public:
  static constexpr std::int32_t kNone = -1;

  explicit IslandPartition(std::size_t objects);

  /// Makes every movable object (flag not 0) an island of its own; the others are in none.
  void reset(std::span<const std::uint8_t> movable) noexcept;
  /// Merges the islands of `a` and `b`. Ignored when one of them is not movable.
  void join(ObjectId a, ObjectId b) noexcept;
  /// The movable object that stands for the island of `object`, as joined so far: the one with the lowest id.
  [[nodiscard]] ObjectId leaderOf(ObjectId object) noexcept;
  /// Numbers islands and their bodies; to be called after join() and before the functions below.
  void assignIslands() noexcept;

  [[nodiscard]] std::size_t count() const { return count_; }
  /// kNone for an object that is not movable.
  [[nodiscard]] std::int32_t islandOf(ObjectId object) const { return island_[object.value]; }
  /// Index of a movable object among the bodies of its island.
  [[nodiscard]] std::int32_t bodyIndexOf(ObjectId object) const { return body_index_[object.value]; }

 private:
  [[nodiscard]] std::int32_t findRoot(std::int32_t object) noexcept;

  std::vector<std::int32_t> parent_;
  std::vector<std::int32_t> island_;
  std::vector<std::int32_t> body_index_;
  std::vector<std::int32_t> size_;
  std::size_t count_ = 0;
};

}  // namespace tenon::simulation
