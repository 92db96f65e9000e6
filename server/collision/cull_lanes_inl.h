// Culling in floats: what is certainly too far. Included once for every instruction set, before its lanes of
// doubles.

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
namespace tenon {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// A bound is a number [voxels] that no exact interpolated distance is below.
namespace cull {

/// By how much the interpolated distance at a point may be less than on the row next to it, b and c away
/// along y and z: its mean is over rows 1 and sqrt(2) away too, of weights b + c - 2 b c and b c.
HWY_INLINE Float lossOfPoint(const InBrick& at) {
  constexpr float kLess = 0.585786F;   // 2 - sqrt(2)
  constexpr float kWhole = 1.707107F;  // 1 / kLess
  const Float rest = all(kWhole - 0.5F);
  const Float b = hn::Add(hn::Abs(at.from_middle.y), rest);
  const Float c = hn::Add(hn::Abs(at.from_middle.z), rest);
  return hn::Sub(all(kWhole), hn::Mul(all(kLess), hn::Mul(b, c)));
}
HWY_INLINE Float boundOfPoint(const Field& field, Whole brick, const InBrick& at) {
  return hn::Sub(valueOf(field, brick, rowOf(at)), lossOfPoint(at));
}

/// Of points in a field with refined bricks: a child answers in its band, its coarse brick beyond, and
/// neither may be near.
HWY_INLINE Float boundsAmongChildren(const Field& field, const Spot& spot) {
  const Mask sampled = hasBrick(spot.entry);
  const Mask refined = isRefined(spot.entry);
  const Children children = childrenOf(field, spot, refined);
  const Whole own = hn::IfThenElse(asWholeMask(refined), children.own, whereSet(sampled, spot.entry));
  const Float bound = boundOfPoint(field, own, spot.at);
  const Mask has_fine = hn::And(refined, hasBrick(children.fine));
  const Whole fine = whereSet(has_fine, children.fine);
  const Float fine_voxel = all(1.0F / static_cast<float>(field.refinement));
  const Float fine_bound = hn::Mul(boundOfPoint(field, fine, children.at), fine_voxel);
  return hn::IfThenElse(has_fine, hn::Min(bound, fine_bound), bound);
}

/// A value's bound over a ball of radius r whose centre is `away` from where the value is. A point of the
/// ball takes its mean from corners about it, and the value may be one of two samples: squares are up to 3/4
/// and 1/4 more in the mean.
HWY_INLINE Float boundOfBall(Float value, Float away, Float r) {
  const Float farthest = hn::Add(away, r);
  return hn::Sub(value, hn::Sqrt(hn::Add(hn::Mul(farthest, farthest), all(1.0F))));
}

/// Where the centre is outside the grid, by how far; elsewhere the bound that there is.
HWY_INLINE Float boundsOutside(const Field& field, const Place3& p, Float bound, Float r) {
  const auto& most = field.cull.most;
  const Place3 beyond{hn::Sub(p.x, clamped(p.x, all(most[0]))), hn::Sub(p.y, clamped(p.y, all(most[1]))),
                      hn::Sub(p.z, clamped(p.z, all(most[2])))};
  const Float away = norm(beyond);
  const Mask outside = hn::Gt(away, hn::Zero(kF));
  if (hn::AllFalse(kF, outside)) return bound;
  // the outermost voxels' middles are half a diagonal from the border
  const Float to_surface = hn::Add(away, all(field.cull.outside - kHalfDiagonal));
  return hn::IfThenElse(outside, hn::Max(bound, boundOfBall(to_surface, hn::Zero(kF), r)), bound);
}

/// By the middle of the centre's brick, as DistanceField::lowerBound.
HWY_INLINE Float boundsByBrick(const Field& field, const Spot& spot, Float r) {
  const auto from_middle = [](Whole voxel, Float from) HWY_ATTR {
    return hn::Add(toFloat(voxel), hn::Sub(from, all(0.5F * (kVoxels - 1))));
  };
  const Float away =
      norm({from_middle(spot.at.x, spot.at.from_middle.x), from_middle(spot.at.y, spot.at.from_middle.y),
            from_middle(spot.at.z, spot.at.from_middle.z)});
  return boundOfBall(farOf(field, spot.number), away, r);
}

/// By the row next to the centre, of lanes whose brick has samples.
HWY_INLINE Float boundsByRow(const Field& field, const Spot& spot, Mask sampled, Float r) {
  Whole brick = spot.entry;
  const Mask refined = isRefined(spot.entry);
  if (!hn::AllFalse(kF, refined)) {
    brick = hn::IfThenElse(asWholeMask(refined), childrenOf(field, spot, refined).own, brick);
  }
  const Float half = all(0.5F);
  const Float b = hn::Sub(half, hn::Abs(spot.at.from_middle.y));
  const Float c = hn::Sub(half, hn::Abs(spot.at.from_middle.z));
  const Float away = hn::Sqrt(hn::Add(hn::Mul(b, b), hn::Mul(c, c)));
  return boundOfBall(valueOf(field, whereSet(sampled, brick), rowOf(spot.at)), away, r);
}

/// `closely`: also by the row next to the centre, where the brick's middle does not tell.
template <bool closely>
HWY_INLINE Float boundsOfBalls(const Field& field, const Place3& p, Float r) {
  const Spot spot = spotOf(field, p);
  const Mask sampled = hasBrick(spot.entry);
  const Float by_brick = boundsByBrick(field, spot, r);
  const Float beyond_band =
      boundOfBall(all(static_cast<float>(DistanceField::kBandVoxels)), all(kHalfDiagonal), r);
  Float bound = hn::IfThenElse(sampled, by_brick, hn::Max(by_brick, beyond_band));
  bound = hn::IfThenElse(isDeep(spot.entry), all(-1e9F), bound);
  bound = boundsOutside(field, p, bound, r);
  if constexpr (!closely) return bound;
  const Mask wanted = hn::And(sampled, hn::Le(bound, all(field.cull.limit)));
  if (hn::AllFalse(kF, wanted)) return bound;
  return hn::IfThenElse(wanted, hn::Max(bound, boundsByRow(field, spot, sampled, r)), bound);
}

/// What was left out, lane by lane.
struct LeftOut {
  explicit LeftOut(Culled& the_culled) : culled(the_culled), smallest(all(the_culled.smallest_bound)) {}
  ~LeftOut() { culled.smallest_bound = hn::GetLane(hn::MinOfLanes(kF, smallest)); }
  LeftOut(const LeftOut&) = delete;
  LeftOut& operator=(const LeftOut&) = delete;

  HWY_INLINE void addUnless(Mask reaches, Float bound) {
    smallest = hn::Min(smallest, hn::IfThenElse(reaches, smallest, bound));
  }

  Culled& culled;
  Float smallest;
};

/// Which balls of a block may hold a contact.
template <bool closely>
HWY_INLINE std::uint32_t reachingBalls(const Field& field, const ShellBlock& balls, LeftOut& left_out) {
  const Float limit = all(field.cull.limit);
  std::uint32_t reaching = 0;
  // lanes that are not in use are as the first
  for (std::size_t i = 0; i < balls.count; i += hn::Lanes(kF)) {
    const Float radius = hn::Mul(hn::LoadU(kF, balls.radius.data() + i), all(field.cull.per_metre));
    const Float bound = boundsOfBalls<closely>(field, inGrid(field.cull, balls, i), radius);
    const Mask reaches = hn::Le(bound, limit);
    left_out.addUnless(reaches, bound);
    reaching |= bitsOf(reaches) << i;
  }
  left_out.culled.spheres += balls.count;
  return reaching & ((1U << balls.count) - 1U);
}

std::uint32_t clusters(const LaneFrame& frame, const ShellBlock& balls, Culled& culled) noexcept {
  LeftOut left_out(culled);
  return reachingBalls<false>(Field(frame), balls, left_out);
}

/// Leaves whose points are looked at.
struct Leaves {
  static constexpr std::size_t kMost = Candidates::kClusters * Pointshell::kClusterLeaves;

  std::array<std::uint32_t, kMost> number;
  std::size_t count = 0;
};

/// What is known of points before their samples are read.
struct Prospects {
  template <typename T>
  using Lanes = std::array<T, Leaves::kMost * ShellBlock::kLanes>;

  alignas(64) Lanes<std::int32_t> entry, place;
  Lanes<float> along, loss;

  HWY_INLINE void store(const Spot& spot, std::size_t i) {
    const Row row = rowOf(spot.at);
    hn::StoreU(spot.entry, kI, entry.data() + i);
    hn::StoreU(row.place, kI, place.data() + i);
    hn::StoreU(row.along, kF, along.data() + i);
    hn::StoreU(lossOfPoint(spot.at), kF, loss.data() + i);
  }
};

/// Of one vector of points, from i of `prospects`, which are at p.
template <typename P>
HWY_INLINE Float boundsOfPoints(const Field& field, const Prospects& prospects, std::size_t i, P&& p) {
  const Whole entry = hn::LoadU(kI, prospects.entry.data() + i);
  const Mask sampled = hasBrick(entry);
  const Float apart = hn::IfThenElse(isDeep(entry), all(-1e9F), all(field.cull.beyond_band));
  if (!hn::AllFalse(kF, isRefined(entry))) {
    return hn::IfThenElse(sampled, boundsAmongChildren(field, spotOf(field, p())), apart);
  }
  const Row row{hn::LoadU(kI, prospects.place.data() + i), hn::LoadU(kF, prospects.along.data() + i)};
  const Float value = valueOf(field, whereSet(sampled, entry), row);
  return hn::IfThenElse(sampled, hn::Sub(value, hn::LoadU(kF, prospects.loss.data() + i)), apart);
}

/// Appends the lanes from i of a leaf that are near.
HWY_INLINE void append(const Pointshell& shell, std::uint32_t leaf, std::size_t i, Mask near,
                       [[maybe_unused]] Number count_up, Candidates& out) {
  const ShellBlock& points = shell.pointsOfLeaf(leaf);
  const std::uint32_t first = shell.leaves()[leaf].first + static_cast<std::uint32_t>(i);
#if HWY_TARGET <= HWY_AVX3
  near = hn::And(near, hn::FirstN(kF, points.count - i));
  const std::uint32_t n = out.count;
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.x.data() + i), near), kF, out.x.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.y.data() + i), near), kF, out.y.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.z.data() + i), near), kF, out.z.data() + n);
  hn::StoreU(hn::Compress(hn::Add(count_up, hn::Set(kU, first)), hn::RebindMask(kU, near)), kU,
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

/// In two rounds: reading is waiting for memory, and for many points at once in short loops.
HWY_INLINE void appendNear(const Field& field, const Pointshell& shell, const Leaves& leaves, Candidates& out,
                           LeftOut& left_out) {
  Prospects prospects;
  for (std::size_t leaf = 0; leaf < leaves.count; ++leaf) {
    const ShellBlock& points = shell.pointsOfLeaf(leaves.number[leaf]);
    for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
      prospects.store(spotOf(field, inGrid(field.cull, points, i)), leaf * ShellBlock::kLanes + i);
    }
  }
  const Float limit = all(field.cull.limit);
  const Number count_up = hn::Iota(kU, 0);
  for (std::size_t leaf = 0; leaf < leaves.count; ++leaf) {
    const ShellBlock& points = shell.pointsOfLeaf(leaves.number[leaf]);
    for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
      const Float bound = boundsOfPoints(field, prospects, leaf * ShellBlock::kLanes + i,
                                         [&]() HWY_ATTR { return inGrid(field.cull, points, i); });
      const Mask near = hn::Le(bound, limit);
      left_out.addUnless(near, bound);
      append(shell, leaves.number[leaf], i, near, count_up, out);
    }
    left_out.culled.points += points.count;
  }
}

void candidates(const LaneFrame& frame, const Pointshell& shell, std::span<const std::uint32_t> of,
                Candidates& out, Culled& culled) noexcept {
  const Field field(frame);
  LeftOut left_out(culled);
  // step by step for all: each step's reads wait for memory together
  std::array<std::uint32_t, Candidates::kClusters> reaching{};
  for (std::size_t i = 0; i < of.size(); ++i) {
    reaching[i] = reachingBalls<true>(field, shell.leavesOfCluster(of[i]), left_out);
  }
  Leaves leaves;
  for (std::size_t i = 0; i < of.size(); ++i) {
    const std::uint32_t first = shell.clusters()[of[i]].first;
    for (std::uint32_t bits = reaching[i]; bits != 0; bits &= bits - 1) {
      leaves.number[leaves.count++] = first + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
  }
  appendNear(field, shell, leaves, out, left_out);
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
