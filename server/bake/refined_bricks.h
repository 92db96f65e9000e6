#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/air_gaps.h"
#include "server/bake/bake.h"
#include "server/bake/brick_level.h"
#include "server/bake/field_size.h"
#include "server/bake/thin_bricks.h"

namespace tenon::bake {

/// The coarse bricks that are refined, in ascending order.
struct RefinedBricks {
  std::vector<std::uint32_t> bricks;
  /// By brick, what the dilation of thin walls is at most: that of coarse voxels at a corner of an unrefined
  /// thin brick, that of fine ones at the others.
  std::vector<BrickLevel::CornerDilations> dilations;
  std::vector<AirGap> refined_gaps;  ///< outside of the boxes of the options, narrowest first
  std::vector<AirGap> coarse_gaps;   ///< that are left, narrowest first
};

/// [-] Bricks of narrow air gaps add at most this to the bytes of the unrefined field.
inline constexpr double kGapBytes = 0.5;

/// Bricks with surface that a box of `options` intersects, and those of `gaps`, narrowest first, as long as
/// they add no more than kGapBytes and the field has no more than `limits` allow; and with both the
/// neighbours where material is `thin`: the dilation decreases inside of these, so that it is small in the
/// whole brick.
[[nodiscard]] RefinedBricks bricksToRefine(const BrickLevel& coarse, const BakeOptions& options,
                                           std::span<const AirGap> gaps, const BrickMarks& thin,
                                           const FieldLimits& limits);

}  // namespace tenon::bake
