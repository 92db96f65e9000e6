#include "server/simulation/islands.h"

#include <algorithm>

namespace tenon::simulation {

IslandPartition::IslandPartition(std::size_t objects)
    : parent_(objects, kNone), island_(objects, kNone), body_index_(objects, 0), size_(objects, 0) {}

void IslandPartition::reset(std::span<const std::uint8_t> movable) noexcept {
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    parent_[i] = movable[i] != 0 ? static_cast<std::int32_t>(i) : kNone;
  }
  count_ = 0;
}

std::int32_t IslandPartition::findRoot(std::int32_t object) noexcept {
  while (parent_[object] != object) {
    parent_[object] = parent_[parent_[object]];
    object = parent_[object];
  }
  return object;
}

void IslandPartition::join(ObjectId a, ObjectId b) noexcept {
  if (parent_[a.value] == kNone || parent_[b.value] == kNone) return;
  const std::int32_t root_a = findRoot(static_cast<std::int32_t>(a.value));
  const std::int32_t root_b = findRoot(static_cast<std::int32_t>(b.value));
  // the lowest id becomes the root, independent of the order of joins
  parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
}

ObjectId IslandPartition::leaderOf(ObjectId object) noexcept {
  return {static_cast<std::uint32_t>(findRoot(static_cast<std::int32_t>(object.value)))};
}

void IslandPartition::assignIslands() noexcept {
  count_ = 0;
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    const auto object = static_cast<std::int32_t>(i);
    if (parent_[i] == kNone) {
      island_[i] = kNone;
      continue;
    }
    const std::int32_t first = findRoot(object);
    if (first == object) {
      island_[i] = static_cast<std::int32_t>(count_);
      size_[count_++] = 0;
    }
    island_[i] = island_[first];
    body_index_[i] = size_[island_[i]]++;
  }
}

}  // namespace tenon::simulation
