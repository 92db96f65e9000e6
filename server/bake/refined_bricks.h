#pragma once

#include <cstdint>
#include <vector>

#include "server/bake/bake.h"
#include "server/bake/brick_level.h"
#include "server/bake/thin_bricks.h"

namespace tenon::bake {

/// The coarse bricks that are refined, in ascending order.
struct RefinedBricks {
  std::vector<std::uint32_t> bricks;
  /// By brick: it is refined because of a neighbour. The dilation of thin walls decreases inside of it, from
  /// that of coarse voxels to that of fine ones, so that it is small in the whole neighbour.
  std::vector<std::uint8_t> deep;
};

/// Bricks with surface that a box of `options` intersects, and those next to them where material is `thin`.
[[nodiscard]] RefinedBricks bricksToRefine(const BrickLevel& coarse, const BakeOptions& options,
                                           const BrickMarks& thin);

}  // namespace tenon::bake
