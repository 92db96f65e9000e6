#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "server/structures/distance_field.h"
#include "server/structures/huge_pages.h"

namespace tenon::structures {

/// The arrays of a field under construction.
///
/// Threads: one; the functions below are pure. Real-time: no.
struct FieldStorage {
  DistanceField::Layout layout;  ///< makeField sets its spans
  HugeVector<DistanceField::Entry> index;
  HugeVector<std::int16_t> samples;
  HugeVector<std::int16_t> far;
  HugeVector<float> dilations;
  HugeVector<std::int32_t> valley_index;
  HugeVector<ValleyBrick> valley_bricks;
  HugeVector<std::uint32_t> valley_cells;
  HugeVector<ValleyPlane> valley_planes;
};

/// The planes of one brick's cells.
struct BrickValleys {
  DistanceField::Entry brick = 0;
  std::array<std::uint64_t, 8> cells{};  ///< as in ValleyBrick
  /// Of these cells in order.
  std::vector<FixedVector<ValleyPlane, DistanceField::kMaxValleyPlanes>> planes;
};

/// A field on arrays that the caller keeps as they are while it is used.
[[nodiscard]] DistanceField viewOf(const FieldStorage& storage);

/// A field that owns the given arrays.
[[nodiscard]] DistanceField makeField(FieldStorage storage);

/// A field that owns the given arrays, with `dilations` [m] (see DistanceField::Layout) taken from its
/// samples, which have none yet. A child of a refined brick whose samples do not reach that far is dropped:
/// its coarse samples are used.
[[nodiscard]] DistanceField makeDilatedField(FieldStorage storage, std::span<const float> dilations);

/// The same field with planes in some cells; `valleys` by brick, in ascending order.
[[nodiscard]] DistanceField withValleys(const DistanceField& field, std::span<const BrickValleys> valleys);

/// A grid of far-outside bricks with edge `voxel` [m] around `surface_box_M`, with one brick of margin on
/// every side.
[[nodiscard]] FieldStorage makeGrid(const Eigen::AlignedBox3d& surface_box_M, double voxel);

/// The stored form of `distance` [m]: quanta of `voxel` [m], clamped to +-`clamp` [voxels].
[[nodiscard]] std::int16_t quantizedSample(double distance, double voxel,
                                           double clamp = DistanceField::kClampVoxels);

/// The stored form in `Layout::far` of `bound` [m] with `voxel` [m]: rounded down, or, for a far-inside brick
/// (`inside_brick`), towards less depth.
[[nodiscard]] std::int16_t quantizedFar(double bound, double voxel, bool inside_brick);

/// Signed distance [m] at a point of M, < 0 inside; must be 1-Lipschitz.
using AnalyticDistance = std::function<double(const Vector3& p_MP)>;

/// The field of a shape given by a formula, with edge `voxel` [m]. The whole surface lies in `surface_box_M`,
/// and outside the grid all space is free: a floor must be a slab. Bricks that contain surface and intersect
/// a box of `refine_M` are refined.
[[nodiscard]] DistanceField buildField(const AnalyticDistance& distance,
                                       const Eigen::AlignedBox3d& surface_box_M, double voxel,
                                       std::span<const Eigen::AlignedBox3d> refine_M = {},
                                       int refinement = 1);

}  // namespace tenon::structures
