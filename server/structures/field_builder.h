#pragma once

#include <functional>
#include <span>
#include <vector>

#include "server/structures/distance_field.h"

namespace tenon {

/// The memory of a field while it is built; `makeField` turns it into a DistanceField that owns it.
struct FieldStorage {
  DistanceField::Layout layout;  ///< its spans are set by makeField
  std::vector<DistanceField::Entry> index;
  std::vector<std::int16_t> samples;
  std::vector<std::int16_t> far;
};

[[nodiscard]] DistanceField makeField(FieldStorage storage);

/// A grid of empty far-outside bricks about `surface_box_M`, with one brick of margin on every side.
[[nodiscard]] FieldStorage makeGrid(const Eigen::AlignedBox3d& surface_box_M, double voxel);

/// A distance as a brick keeps it: in quanta of its voxel, clamped to +-kClampVoxels.
[[nodiscard]] std::int16_t quantizedSample(double distance, double voxel);

/// A bound as `far` keeps it, rounded so that it stays a lower bound (of the depth where negative inside).
[[nodiscard]] std::int16_t quantizedFar(double bound, double voxel, bool inside_brick);

/// Signed distance at a point of M [m], < 0 inside; at most 1 m steeper a metre.
using AnalyticDistance = std::function<double(const Vector3& p_MP)>;

/// A field of a shape with a formula. The whole surface lies in `surface_box_M`: outside the grid everything
/// is free, so a floor is a slab. Bricks whose voxels meet the surface inside a box of `refine_M` are
/// refined.
[[nodiscard]] DistanceField buildField(const AnalyticDistance& distance,
                                       const Eigen::AlignedBox3d& surface_box_M, double voxel,
                                       std::span<const Eigen::AlignedBox3d> refine_M = {},
                                       int refinement = 1);

}  // namespace tenon
