#pragma once

#include <span>
#include <string>

#include "server/bake/bake.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

/// How large a field may become.
struct FieldLimits {
  std::size_t level_bricks =
      1'000'000;  ///< with samples, of one voxel size: 1,458 bytes and working memory, 3 GB
  std::size_t field_bricks =
      structures::DistanceField::kMaxBricks;  ///< with samples, coarse and refined: what a reader takes
  double grid_bricks =
      40e6;  ///< [bricks] coarse, with and without samples: 250 MB of index, bounds and lists
};

/// The size of the field that a bake would make, in bricks.
struct FieldSize {
  double grid = 0.0;     ///< [bricks] coarse, with and without samples
  double coarse = 0.0;   ///< [bricks] with samples
  double refined = 0.0;  ///< [bricks] with samples, in the boxes to refine
};

/// Estimates the size of a field in a fraction of a second for any voxel, before anything is allocated or
/// sampled. An octree of the bricks near triangles is built from one cube around all; where a level has more
/// than a few thousand cubes, every n-th of them stands for n. So the error is a few per cent, for triangles
/// of any size and arrangement.
[[nodiscard]] FieldSize estimateSize(std::span<const structures::Triangle> triangles,
                                     const BakeOptions& options);

/// What to say of a mesh whose field would exceed the limits by more than the error of an estimate, with its
/// size and what helps; empty when it does not.
[[nodiscard]] std::string whyTooLarge(std::span<const structures::Triangle> triangles,
                                      const BakeOptions& options, const FieldLimits& limits);

/// The same for `bricks` [bricks] with samples, counted, that exceed `limit`: with the coarse voxels, or
/// (`refined`) with those in the boxes to refine.
[[nodiscard]] std::string tooManyBricks(double bricks, std::size_t limit, bool refined,
                                        const BakeOptions& options);

}  // namespace tenon::bake
