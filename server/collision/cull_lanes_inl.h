// Culling in single precision. Included once for every instruction set, before the kernels in double
// precision.

#if defined(TENON_CULL_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_CULL_LANES
#undef TENON_CULL_LANES
#else
#define TENON_CULL_LANES
#endif

#include <array>
#include <bit>

#include <hwy/highway.h>

#include "server/collision/brick_lanes_inl.h"
#include "server/collision/query_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace tenon::collision {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// A bound is a lower bound [voxels] of all exact interpolated distances at a point or in a ball.
namespace cull {

/// [voxels] By how much the interpolated distance at a point may be less than that on the nearest row of
/// samples. For offsets b and c from that row along y and z, interpolation also weighs the rows at distance 1
/// by b + c - 2 b c and the row at distance sqrt(2) by b c; samples differ by no more than the field's slope
/// times their distance.
HWY_INLINE Float rowErrorBound(const CullField& field, const BrickPoint& at) {
  constexpr float kWeight = 0.585786F;         // 2 - sqrt(2)
  constexpr float kInverseWeight = 1.707107F;  // 1 / kWeight
  const Float rest = splat(kInverseWeight - 0.5F);
  const Float b = hn::Add(hn::Abs(at.from_centre.y), rest);
  const Float c = hn::Add(hn::Abs(at.from_centre.z), rest);
  const Float error = hn::Sub(splat(kInverseWeight), hn::Mul(splat(kWeight), hn::Mul(b, c)));
  return hn::Mul(splat(field.cull.slope), error);
}
HWY_INLINE Float pointBound(const CullField& field, Int brick, const BrickPoint& at) {
  return hn::Sub(interpolateRow(field, brick, nearestRow(at)), rowErrorBound(field, at));
}

/// Bounds of points in a field with refined bricks. Inside its band the child is sampled, beyond it the
/// coarse brick: the smaller bound of both.
HWY_INLINE Float refinedPointBounds(const CullField& field, const VoxelLocation& location) {
  const Mask sampled = hasBrick(location.entry);
  const Mask refined = isRefined(location.entry);
  const Children children = locateChildren(field, location, refined);
  const Int own = hn::IfThenElse(asIntMask(refined), children.own, zeroUnless(sampled, location.entry));
  const Float bound = pointBound(field, own, location.at);
  const Mask has_fine = hn::And(refined, hasBrick(children.fine));
  const Int fine = zeroUnless(has_fine, children.fine);
  const Float fine_voxel = splat(1.0F / static_cast<float>(field.refinement));
  const Float fine_bound = hn::Mul(pointBound(field, fine, children.at), fine_voxel);
  return hn::IfThenElse(has_fine, hn::Min(bound, fine_bound), bound);
}

/// Bound over a ball of radius r from a `value` at `distance` from the ball's centre. Interpolation averages
/// the corners around a point of the ball, and the value may be the average of two samples: that adds at most
/// 3/4 and 1/4 to the mean squared distance between them.
HWY_INLINE Float ballBound(const CullField& field, Float value, Float distance, Float r) {
  const Float farthest = hn::Add(distance, r);
  const Float length = hn::Sqrt(hn::Add(hn::Mul(farthest, farthest), splat(1.0F)));
  return hn::Sub(value, hn::Mul(splat(field.cull.slope), length));
}

/// Improves the bound of balls whose centre is outside the grid by the distance to the grid.
HWY_INLINE Float boundsOutsideGrid(const CullField& field, const Vec3& p, Float bound, Float r) {
  const auto& last_voxel = field.cull.last_voxel;
  const Vec3 outside_by{hn::Sub(p.x, clamped(p.x, splat(last_voxel[0]))),
                        hn::Sub(p.y, clamped(p.y, splat(last_voxel[1]))),
                        hn::Sub(p.z, clamped(p.z, splat(last_voxel[2])))};
  const Float distance = norm(outside_by);
  const Mask outside = hn::Gt(distance, hn::Zero(kF));
  if (hn::AllFalse(kF, outside)) return bound;
  // the centres of the outermost voxels are up to half a diagonal from the border
  const Float to_surface = hn::Add(distance, splat(field.cull.outside_grid - kHalfDiagonal));
  return hn::IfThenElse(outside, hn::Max(bound, ballBound(field, to_surface, hn::Zero(kF), r)), bound);
}

/// Bounds from the value at the centre of the brick that holds the ball's centre, as
/// DistanceField::lowerBound.
HWY_INLINE Float ballBoundsByBrick(const CullField& field, const VoxelLocation& location, Float r) {
  const auto from_centre = [](Int voxel, Float from) HWY_ATTR {
    return hn::Add(toFloat(voxel), hn::Sub(from, splat(0.5F * (kVoxels - 1))));
  };
  const Float distance = norm({from_centre(location.at.x, location.at.from_centre.x),
                               from_centre(location.at.y, location.at.from_centre.y),
                               from_centre(location.at.z, location.at.from_centre.z)});
  return ballBound(field, farBound(field, location.brick_index), distance, r);
}

/// Bounds from the row of samples nearest to the ball's centre, for lanes whose brick has samples.
HWY_INLINE Float ballBoundsByRow(const CullField& field, const VoxelLocation& location, Mask sampled,
                                 Float r) {
  Int brick = location.entry;
  const Mask refined = isRefined(location.entry);
  if (!hn::AllFalse(kF, refined)) {
    brick = hn::IfThenElse(asIntMask(refined), locateChildren(field, location, refined).own, brick);
  }
  const Float half = splat(0.5F);
  const Float b = hn::Sub(half, hn::Abs(location.at.from_centre.y));
  const Float c = hn::Sub(half, hn::Abs(location.at.from_centre.z));
  const Float distance = hn::Sqrt(hn::Add(hn::Mul(b, b), hn::Mul(c, c)));
  return ballBound(field, interpolateRow(field, zeroUnless(sampled, brick), nearestRow(location.at)),
                   distance, r);
}

/// `use_row`: where the bound by brick does not suffice, also the bound by row.
template <bool use_row>
HWY_INLINE Float ballBounds(const CullField& field, const Vec3& p, Float r) {
  const VoxelLocation location = locateVoxel(field, p);
  const Mask sampled = hasBrick(location.entry);
  const Float by_brick = ballBoundsByBrick(field, location, r);
  const Float beyond_band = ballBound(field, splat(field.cull.band), splat(kHalfDiagonal), r);
  Float bound = hn::IfThenElse(sampled, by_brick, hn::Max(by_brick, beyond_band));
  bound = hn::IfThenElse(isFarInside(location.entry), splat(-1e9F), bound);
  bound = boundsOutsideGrid(field, p, bound, r);
  if constexpr (!use_row) return bound;
  const Mask refinable = hn::And(sampled, hn::Le(bound, splat(field.cull.limit)));
  if (hn::AllFalse(kF, refinable)) return bound;
  return hn::IfThenElse(refinable, hn::Max(bound, ballBoundsByRow(field, location, sampled, r)), bound);
}

/// Accumulates the smallest bound of what was culled, per lane; reduced to one value on destruction.
struct CulledBound {
  explicit CulledBound(CullResult& the_culled)
      : culled(the_culled), smallest(splat(the_culled.smallest_bound)) {}
  ~CulledBound() { culled.smallest_bound = hn::GetLane(hn::MinOfLanes(kF, smallest)); }
  CulledBound(const CulledBound&) = delete;
  CulledBound& operator=(const CulledBound&) = delete;

  HWY_INLINE void addWhereNot(Mask is_in_reach, Float bound) {
    smallest = hn::Min(smallest, hn::IfThenElse(is_in_reach, smallest, bound));
  }

  CullResult& culled;
  Float smallest;
};

/// Bit mask of the balls of a block that may hold a contact.
template <bool use_row>
HWY_INLINE std::uint32_t ballsInReach(const CullField& field, const structures::ShellBlock& balls,
                                      CulledBound& skipped) {
  const Float limit = splat(field.cull.limit);
  std::uint32_t in_reach = 0;
  // unused lanes repeat the first one
  for (std::size_t i = 0; i < balls.count; i += hn::Lanes(kF)) {
    const Float radius = hn::Mul(hn::LoadU(kF, balls.radius.data() + i), splat(field.cull.per_metre));
    const Float bound = ballBounds<use_row>(field, inGrid(field.cull, balls, i), radius);
    const Mask is_in_reach = hn::Le(bound, limit);
    skipped.addWhereNot(is_in_reach, bound);
    in_reach |= bitsOf(is_in_reach) << i;
  }
  skipped.culled.spheres += balls.count;
  return in_reach & ((1U << balls.count) - 1U);
}

/// QueryKernels::clusters
std::uint32_t clusters(const LaneFrame& frame, const structures::ShellBlock& balls,
                       CullResult& culled) noexcept {
  CulledBound skipped(culled);
  return ballsInReach<false>(CullField(frame), balls, skipped);
}

/// Indices of the leaves whose points are tested.
struct LeafBatch {
  static constexpr std::size_t kCapacity =
      Candidates::kBatchClusters * structures::Pointshell::kClusterLeaves;

  std::array<std::uint32_t, kCapacity> index;
  std::size_t count = 0;
};

/// Location and row error of points whose samples are not read yet.
struct CandidateBounds {
  template <typename T>
  using Lanes = std::array<T, LeafBatch::kCapacity * structures::ShellBlock::kLanes>;

  alignas(64) Lanes<std::int32_t> entry, offset;
  Lanes<float> fraction, row_error;

  HWY_INLINE void store(const CullField& field, const VoxelLocation& location, std::size_t i) {
    const SampleRow row = nearestRow(location.at);
    hn::StoreU(location.entry, kI, entry.data() + i);
    hn::StoreU(row.offset, kI, offset.data() + i);
    hn::StoreU(row.fraction, kF, fraction.data() + i);
    hn::StoreU(rowErrorBound(field, location.at), kF, row_error.data() + i);
  }
};

/// Bounds of one vector of points: those from number i in `bounds`; p() returns their positions.
template <typename P>
HWY_INLINE Float pointBounds(const CullField& field, const CandidateBounds& bounds, std::size_t i, P&& p) {
  const Int entry = hn::LoadU(kI, bounds.entry.data() + i);
  const Mask sampled = hasBrick(entry);
  const Float unsampled = hn::IfThenElse(isFarInside(entry), splat(-1e9F), splat(field.cull.beyond_band));
  if (!hn::AllFalse(kF, isRefined(entry))) {
    return hn::IfThenElse(sampled, refinedPointBounds(field, locateVoxel(field, p())), unsampled);
  }
  const SampleRow row{hn::LoadU(kI, bounds.offset.data() + i), hn::LoadU(kF, bounds.fraction.data() + i)};
  const Float value = interpolateRow(field, zeroUnless(sampled, entry), row);
  return hn::IfThenElse(sampled, hn::Sub(value, hn::LoadU(kF, bounds.row_error.data() + i)), unsampled);
}

/// Appends the `near` lanes of the vector that starts at point i of a leaf.
HWY_INLINE void append(const structures::Pointshell& shell, std::uint32_t leaf, std::size_t i, Mask near,
                       [[maybe_unused]] UInt iota, Candidates& out) {
  const structures::ShellBlock& points = shell.pointsOfLeaf(leaf);
  const std::uint32_t first = shell.leaves()[leaf].first + static_cast<std::uint32_t>(i);
#if HWY_TARGET <= HWY_AVX3
  near = hn::And(near, hn::FirstN(kF, points.count - i));
  const std::uint32_t n = out.count;
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.x.data() + i), near), kF, out.x.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.y.data() + i), near), kF, out.y.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.z.data() + i), near), kF, out.z.data() + n);
  hn::StoreU(hn::Compress(hn::Add(iota, hn::Set(kU, first)), hn::RebindMask(kU, near)), kU,
             out.point.data() + n);
  out.count += static_cast<std::uint32_t>(hn::CountTrue(kF, near));
#else
  const std::uint32_t used = (1U << (points.count - i)) - 1U;
  for (std::uint32_t bits = bitsOf(near) & used; bits != 0; bits &= bits - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
    out.x[out.count] = points.x[i + lane];
    out.y[out.count] = points.y[i + lane];
    out.z[out.count] = points.z[i + lane];
    out.point[out.count++] = first + lane;
  }
#endif
}

/// Appends the points that may be contacts. In two passes, index then samples: each pass is a short loop
/// whose memory accesses overlap.
HWY_INLINE void appendCandidates(const CullField& field, const structures::Pointshell& shell,
                                 const LeafBatch& leaves, Candidates& out, CulledBound& skipped) {
  CandidateBounds bounds;
  for (std::size_t leaf = 0; leaf < leaves.count; ++leaf) {
    const structures::ShellBlock& points = shell.pointsOfLeaf(leaves.index[leaf]);
    for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
      bounds.store(field, locateVoxel(field, inGrid(field.cull, points, i)),
                   leaf * structures::ShellBlock::kLanes + i);
    }
  }
  const Float limit = splat(field.cull.limit);
  const UInt iota = hn::Iota(kU, 0);
  for (std::size_t leaf = 0; leaf < leaves.count; ++leaf) {
    const structures::ShellBlock& points = shell.pointsOfLeaf(leaves.index[leaf]);
    for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
      const Float bound = pointBounds(field, bounds, leaf * structures::ShellBlock::kLanes + i,
                                      [&]() HWY_ATTR { return inGrid(field.cull, points, i); });
      const Mask near = hn::Le(bound, limit);
      skipped.addWhereNot(near, bound);
      append(shell, leaves.index[leaf], i, near, iota, out);
    }
    skipped.culled.points += points.count;
  }
}

/// QueryKernels::candidates
void candidates(const LaneFrame& frame, const structures::Pointshell& shell,
                std::span<const std::uint32_t> cluster_indices, Candidates& out,
                CullResult& culled) noexcept {
  const CullField field(frame);
  CulledBound skipped(culled);
  // one step for all clusters, then the next: memory accesses of a step overlap
  std::array<std::uint32_t, Candidates::kBatchClusters> in_reach{};
  for (std::size_t i = 0; i < cluster_indices.size(); ++i) {
    in_reach[i] = ballsInReach<true>(field, shell.leavesOfCluster(cluster_indices[i]), skipped);
  }
  LeafBatch leaves;
  for (std::size_t i = 0; i < cluster_indices.size(); ++i) {
    const std::uint32_t first = shell.clusters()[cluster_indices[i]].first;
    for (std::uint32_t bits = in_reach[i]; bits != 0; bits &= bits - 1) {
      leaves.index[leaves.count++] = first + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
  }
  appendCandidates(field, shell, leaves, out, skipped);
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#endif
