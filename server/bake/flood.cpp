#include "server/bake/flood.h"

#include <algorithm>

namespace tenon::bake {

namespace {

using FloodMask = BrickLevel::Mask;
constexpr std::size_t kFloodVoxels = BrickLevel::kVoxels;
constexpr std::uint64_t kLowX = 0x0101010101010101ULL;
constexpr std::uint64_t kHighX = kLowX << 7U;

bool any(const FloodMask& mask) {
  return std::any_of(mask.begin(), mask.end(), [](std::uint64_t word) { return word != 0; });
}

/// The samples beyond a face (-x +x -y +y -z +z) that are connected to those of a mask. For the lower faces
/// the neighbour has the links.
FloodMask connectedAcross(const FloodMask& mask, int face, const Flood::Links& own,
                          const Flood::Links& neighbour) {
  FloodMask onto{};
  for (std::size_t z = 0; z < kFloodVoxels && face < 4; ++z) {
    if (face == 0) onto[z] = (mask[z] & kLowX) << 7U & neighbour.x[z];
    if (face == 1) onto[z] = (mask[z] & own.x[z] & kHighX) >> 7U;
    if (face == 2) onto[z] = mask[z] << 56U & neighbour.y[z];
    if (face == 3) onto[z] = (mask[z] & own.y[z]) >> 56U;
  }
  if (face == 4) onto[kFloodVoxels - 1] = mask[0] & neighbour.z[kFloodVoxels - 1];
  if (face == 5) onto[0] = mask[kFloodVoxels - 1] & own.z[kFloodVoxels - 1];
  return onto;
}

}  // namespace

Flood::Flood(BrickLevel& level, const std::vector<Links>& links, std::vector<Mask>& reached,
             bool through_empty)
    : level_(level),
      links_(links),
      reached_(reached),
      through_empty_(through_empty),
      queued_(level.nodes(), 0) {}

void Flood::seed(std::size_t node, const Mask& mask) {
  const std::int32_t slot = level_.slot[node];
  if (slot < 0) {
    if (level_.free[node] != 0) return;
    if (!through_empty_) {
      blocked_ = true;
      return;
    }
    level_.free[node] = 1;
  } else {
    Mask& reached = reached_[static_cast<std::size_t>(slot)];
    const Mask before = reached;
    for (std::size_t z = 0; z < kFloodVoxels; ++z) reached[z] |= mask[z];
    if (reached == before) return;
  }
  if (queued_[node] != 0) return;
  queued_[node] = 1;
  pending_.push_back(node);
}

void Flood::run() {
  while (!pending_.empty()) {
    const std::size_t node = pending_.back();
    pending_.pop_back();
    queued_[node] = 0;
    Mask mask;
    mask.fill(~std::uint64_t{0});
    if (const std::int32_t slot = level_.slot[node]; slot >= 0) {
      reached_nodes_.push_back(node);
      fillBrick(static_cast<std::size_t>(slot));
      mask = reached_[static_cast<std::size_t>(slot)];
    }
    const BrickLevel::Cell brick = level_.brickOf(node);
    for (int face = 0; face < 6; ++face) {
      BrickLevel::Cell neighbour = brick;
      neighbour[face / 2] += face % 2 == 0 ? -1 : 1;
      const std::int64_t found = level_.nodeAt(neighbour);
      if (found < 0) continue;
      const auto other = static_cast<std::size_t>(found);
      const Mask onto = connectedAcross(mask, face, linksOf(node), linksOf(other));
      if (any(onto)) seed(other, onto);
    }
  }
}

std::vector<std::size_t> Flood::takeReachedNodes() {
  std::sort(reached_nodes_.begin(), reached_nodes_.end());
  reached_nodes_.erase(std::unique(reached_nodes_.begin(), reached_nodes_.end()), reached_nodes_.end());
  return std::exchange(reached_nodes_, {});
}

void Flood::fillBrick(std::size_t slot) {
  Mask& reached = reached_[slot];
  const Links& links = links_[slot];
  for (bool changed = true; changed;) {
    Mask next;
    for (std::size_t z = 0; z < kFloodVoxels; ++z) {
      const std::uint64_t e = reached[z];
      next[z] = e | (e & links.x[z] & ~kHighX) << 1U | (e >> 1U & links.x[z] & ~kHighX) |
                (e & links.y[z]) << 8U | (e >> 8U & links.y[z]);
      if (z > 0) next[z] |= reached[z - 1] & links.z[z - 1];
      if (z + 1 < kFloodVoxels) next[z] |= reached[z + 1] & links.z[z];
    }
    changed = next != reached;
    reached = next;
  }
}

const Flood::Links& Flood::linksOf(std::size_t node) const {
  static const Links all = linksWhere([](int, int) { return true; });
  const std::int32_t slot = level_.slot[node];
  return slot < 0 ? all : links_[static_cast<std::size_t>(slot)];
}

}  // namespace tenon::bake
