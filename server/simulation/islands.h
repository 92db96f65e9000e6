#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"

namespace tenon {

/// Which movable bodies have to be solved together (contact islands): union-find over pairs of bodies that
/// could touch in this tick. A body that stands still joins nothing, so a bay with five parts in it does not
/// make one island of two people's hands.
///
/// Islands are numbered by their lowest body and list their bodies in order: the same in every run.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class IslandPartition {
 public:
  static constexpr std::int32_t kNone = -1;

  explicit IslandPartition(std::size_t objects);

  /// Every movable object is alone; the others are in no island.
  void begin(std::span<const std::uint8_t> movable) noexcept;
  /// The two belong together. Ignored when one of them does not move.
  void join(ObjectId a, ObjectId b) noexcept;
  /// Numbers the islands; to be called before the queries below.
  void number() noexcept;

  [[nodiscard]] std::size_t count() const { return count_; }
  /// kNone for what does not move.
  [[nodiscard]] std::int32_t islandOf(ObjectId object) const { return island_[object.value]; }
  /// Place of an object among the bodies of its island.
  [[nodiscard]] std::int32_t placeOf(ObjectId object) const { return place_[object.value]; }

 private:
  [[nodiscard]] std::int32_t root(std::int32_t object) noexcept;

  std::vector<std::int32_t> parent_;
  std::vector<std::int32_t> island_;
  std::vector<std::int32_t> place_;
  std::vector<std::int32_t> size_;
  std::size_t count_ = 0;
};

}  // namespace tenon
