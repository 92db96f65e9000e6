// Culling in floats: what is certainly too far. Included once for every instruction set, before its lanes of
// doubles.

#if defined(TENON_CULL_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_CULL_LANES
#undef TENON_CULL_LANES
#else
#define TENON_CULL_LANES
#endif

#include <bit>

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace tenon {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Everything in voxels. A bound is a number that no distance, and no exact interpolated one, is below.
namespace cull {

constexpr HWY_CAPPED(float, 16) kF;
constexpr hn::Rebind<std::int32_t, decltype(kF)> kI;
constexpr hn::Rebind<std::uint32_t, decltype(kF)> kU;
using Float = hn::Vec<decltype(kF)>;
using Whole = hn::Vec<decltype(kI)>;
using Mask = hn::Mask<decltype(kF)>;

constexpr int kVoxels = DistanceField::kBrickVoxels;
constexpr int kSide = DistanceField::kBrickSide;

HWY_INLINE Float all(float value) { return hn::Set(kF, value); }
HWY_INLINE Whole allWhole(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Float toFloat(Whole v) { return hn::ConvertTo(kF, v); }
HWY_INLINE Whole truncated(Float v) { return hn::ConvertTo(kI, v); }
HWY_INLINE Mask asMask(hn::Mask<decltype(kI)> mask) { return hn::RebindMask(kF, mask); }
HWY_INLINE hn::Mask<decltype(kI)> asWholeMask(Mask mask) { return hn::RebindMask(kI, mask); }

HWY_INLINE Mask hasBrick(Whole entry) { return asMask(hn::Gt(entry, allWhole(-1))); }

HWY_INLINE std::uint32_t bitsOf(Mask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(kF, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8U;
}

struct Place3 {
  Float x, y, z;
};

HWY_INLINE Float sum3(Float a, Float b, Float c) { return hn::Add(hn::Add(a, b), c); }
HWY_INLINE Float norm(const Place3& v) {
  return hn::Sqrt(sum3(hn::Mul(v.x, v.x), hn::Mul(v.y, v.y), hn::Mul(v.z, v.z)));
}

/// Field and frame as culling reads them.
struct Field {
  explicit Field(const LaneFrame& frame)
      : layout(frame.field.layout()),
        cull(frame.cull),
        samples(reinterpret_cast<const std::int32_t*>(layout.samples.data())),
        far(reinterpret_cast<const std::int32_t*>(layout.far.data())) {}

  const DistanceField::Layout& layout;
  const CullFrame& cull;
  const std::int32_t* samples;  ///< read at byte offsets, two samples at a time
  const std::int32_t* far;
};

HWY_INLINE Place3 inGrid(const CullFrame& cull, const ShellBlock& block, std::size_t i) {
  const Float x = hn::LoadU(kF, block.x.data() + i);
  const Float y = hn::LoadU(kF, block.y.data() + i);
  const Float z = hn::LoadU(kF, block.z.data() + i);
  const auto row = [&](std::size_t k) HWY_ATTR {
    return hn::Add(all(cull.p[k]), sum3(hn::Mul(all(cull.R[k]), x), hn::Mul(all(cull.R[3 + k]), y),
                                        hn::Mul(all(cull.R[6 + k]), z)));
  };
  return {row(0), row(1), row(2)};
}

/// A lane's brick; lanes outside the grid stand at its lowest corner.
struct Spot {
  Mask inside;
  Whole number, entry;
  Place3 p_brick;  ///< 0 to 8
};

HWY_INLINE Spot spotOf(const Field& field, Place3 p) {
  const auto& end = field.cull.end;
  const auto& bricks = field.layout.bricks;
  const Float zero = hn::Zero(kF);
  Spot spot;
  spot.inside = hn::And(hn::And(hn::And(hn::Ge(p.x, zero), hn::Lt(p.x, all(end[0]))),
                                hn::And(hn::Ge(p.y, zero), hn::Lt(p.y, all(end[1])))),
                        hn::And(hn::Ge(p.z, zero), hn::Lt(p.z, all(end[2]))));
  p = {hn::IfThenElseZero(spot.inside, p.x), hn::IfThenElseZero(spot.inside, p.y),
       hn::IfThenElseZero(spot.inside, p.z)};
  const Float per_voxel = all(1.0F / kVoxels);
  const Float voxels = all(kVoxels);
  const Whole bx = truncated(hn::Mul(p.x, per_voxel));
  const Whole by = truncated(hn::Mul(p.y, per_voxel));
  const Whole bz = truncated(hn::Mul(p.z, per_voxel));
  spot.p_brick = {hn::Sub(p.x, hn::Mul(toFloat(bx), voxels)), hn::Sub(p.y, hn::Mul(toFloat(by), voxels)),
                  hn::Sub(p.z, hn::Mul(toFloat(bz), voxels))};
  spot.number = hn::Add(hn::Mul(hn::Add(hn::Mul(bz, allWhole(bricks[1])), by), allWhole(bricks[0])), bx);
  spot.entry = hn::GatherIndex(kI, field.layout.index.data(), spot.number);
  return spot;
}

/// The sample next to a place in a brick, and the way from there along each axis, 0 to 0.5.
struct NextSample {
  Float value;
  Place3 away;
};

HWY_INLINE NextSample nextSample(const Field& field, Whole brick, const Place3& p_brick) {
  const Float half = all(0.5F);
  const Whole x = truncated(hn::Add(p_brick.x, half));
  const Whole y = truncated(hn::Add(p_brick.y, half));
  const Whole z = truncated(hn::Add(p_brick.z, half));
  // the last along x is the upper half of the pair before it
  const Whole last = allWhole(kVoxels - 1);
  const Whole row =
      hn::Add(hn::Mul(hn::Add(hn::Mul(z, allWhole(kSide)), y), allWhole(kSide)), hn::Min(x, last));
  const Whole place = hn::ShiftLeft<1>(hn::Add(hn::Mul(brick, allWhole(DistanceField::kBrickSamples)), row));
  const Whole pair = hn::GatherOffset(kI, field.samples, place);
  const Whole upper = hn::IfThenElse(hn::Gt(x, last), pair, hn::ShiftLeft<16>(pair));
  constexpr float kPerQuantum = 1.0F / DistanceField::kQuantaPerVoxel;
  return {hn::Mul(toFloat(hn::ShiftRight<16>(upper)), all(kPerQuantum)),
          {hn::Abs(hn::Sub(p_brick.x, toFloat(x))), hn::Abs(hn::Sub(p_brick.y, toFloat(y))),
           hn::Abs(hn::Sub(p_brick.z, toFloat(z)))}};
}

/// For a point: the corners of its cell lie sqrt(1), sqrt(2) or sqrt(3) from the next sample, and weighted as
/// the interpolation does their mean is at most the root of the mean square.
HWY_INLINE Float boundOfPoint(const NextSample& next) {
  return hn::Sub(next.value, hn::Sqrt(sum3(next.away.x, next.away.y, next.away.z)));
}

/// The bricks behind refined entries: a child, and the coarse brick itself.
struct Children {
  Whole fine, own;
  Place3 p_fine;
};

HWY_INLINE Children childrenOf(const Field& field, const Spot& spot, Mask refined) {
  const std::int32_t r = field.layout.refinement;
  const Float scale = all(static_cast<float>(r) / kVoxels);
  const Whole most = allWhole(r - 1);
  const Place3 p{hn::Mul(spot.p_brick.x, scale), hn::Mul(spot.p_brick.y, scale),
                 hn::Mul(spot.p_brick.z, scale)};
  const Whole x = hn::Min(truncated(p.x), most);
  const Whole y = hn::Min(truncated(p.y), most);
  const Whole z = hn::Min(truncated(p.z), most);
  // lanes without children read any entry
  const auto mask = asWholeMask(refined);
  const Whole first = hn::IfThenElseZero(mask, hn::Sub(spot.entry, allWhole(DistanceField::kRefined)));
  const Whole child = hn::Add(hn::Mul(hn::Add(hn::Mul(z, allWhole(r)), y), allWhole(r)), x);
  const Whole fine = hn::IfThenElseZero(mask, hn::Add(first, child));
  const Whole own = hn::IfThenElseZero(mask, hn::Add(first, allWhole(r * r * r)));
  const Float voxels = all(kVoxels);
  return {hn::GatherIndex(kI, field.layout.index.data(), fine),
          hn::GatherIndex(kI, field.layout.index.data(), own),
          {hn::Min(hn::Mul(hn::Sub(p.x, toFloat(x)), voxels), voxels),
           hn::Min(hn::Mul(hn::Sub(p.y, toFloat(y)), voxels), voxels),
           hn::Min(hn::Mul(hn::Sub(p.z, toFloat(z)), voxels), voxels)}};
}

HWY_INLINE Mask isRefined(const Spot& spot) {
  return hn::And(spot.inside, asMask(hn::Gt(spot.entry, allWhole(DistanceField::kRefined - 1))));
}

HWY_INLINE Float pointBounds(const Field& field, const Place3& p) {
  const Spot spot = spotOf(field, p);
  const Mask deep = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarInside)));
  Float bound = hn::IfThenElse(deep, all(-1e9F), all(field.cull.beyond_band));
  bound = hn::IfThenElse(spot.inside, bound, all(field.cull.outside));
  const Mask sampled = hn::And(spot.inside, hasBrick(spot.entry));
  if (hn::AllFalse(kF, sampled)) return bound;
  const Mask refined = isRefined(spot);
  if (hn::AllFalse(kF, refined)) {
    const Whole brick = hn::IfThenElseZero(asWholeMask(sampled), spot.entry);
    return hn::IfThenElse(sampled, boundOfPoint(nextSample(field, brick, spot.p_brick)), bound);
  }
  // a child answers in its band, its coarse brick beyond: neither may be near
  const Children children = childrenOf(field, spot, refined);
  const Whole own = hn::IfThenElse(asWholeMask(refined), children.own,
                                   hn::IfThenElseZero(asWholeMask(sampled), spot.entry));
  bound = hn::IfThenElse(sampled, boundOfPoint(nextSample(field, own, spot.p_brick)), bound);
  const Mask has_fine = hn::And(refined, hasBrick(children.fine));
  const Whole fine = hn::IfThenElseZero(asWholeMask(has_fine), children.fine);
  const Float fine_voxel = all(1.0F / static_cast<float>(field.layout.refinement));
  const Float fine_bound = hn::Mul(boundOfPoint(nextSample(field, fine, children.p_fine)), fine_voxel);
  return hn::IfThenElse(has_fine, hn::Min(bound, fine_bound), bound);
}

HWY_INLINE Float farOf(const Field& field, Whole number) {
  // two at a time: the last is the upper half of the pair before it
  const Whole last = allWhole(static_cast<std::int32_t>(2 * field.layout.far.size() - 4));
  const Whole wanted = hn::ShiftLeft<1>(number);
  const Whole pair = hn::GatherOffset(kI, field.far, hn::Min(wanted, last));
  const Whole upper = hn::IfThenElse(hn::Gt(wanted, last), pair, hn::ShiftLeft<16>(pair));
  return hn::Mul(toFloat(hn::ShiftRight<16>(upper)), all(1.0F / DistanceField::kFarPerVoxel));
}

/// For places as DistanceField::lowerBound.
HWY_INLINE Float farBounds(const Field& field, const Place3& p, const Spot& spot) {
  const Float middle = all(0.5F * kVoxels);
  const Float from_centre = norm(
      {hn::Sub(spot.p_brick.x, middle), hn::Sub(spot.p_brick.y, middle), hn::Sub(spot.p_brick.z, middle)});
  const Float at_centre = farOf(field, spot.number);
  // the interpolant may lie below the distance by half a voxel's diagonal
  Float bound = hn::Sub(hn::Sub(at_centre, all(1.0F)), from_centre);
  const Mask outside = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarOutside)));
  bound =
      hn::IfThenElse(outside, hn::Max(all(field.cull.beyond_band), hn::Sub(at_centre, from_centre)), bound);
  const Mask deep = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarInside)));
  bound = hn::IfThenElse(deep, all(-1e9F), bound);
  if (hn::AllTrue(kF, spot.inside)) return bound;
  const auto& end = field.cull.end;
  const Float zero = hn::Zero(kF);
  const Place3 beyond{hn::Max(hn::Max(hn::Neg(p.x), hn::Sub(p.x, all(end[0]))), zero),
                      hn::Max(hn::Max(hn::Neg(p.y), hn::Sub(p.y, all(end[1]))), zero),
                      hn::Max(hn::Max(hn::Neg(p.z), hn::Sub(p.z, all(end[2]))), zero)};
  return hn::IfThenElse(spot.inside, bound, hn::Add(norm(beyond), all(field.cull.outside)));
}

/// A ball whose centre's brick has samples: by the one next to the centre.
HWY_INLINE Float closerBounds(const Field& field, const Spot& spot, Float bound, Mask wanted) {
  const Mask sampled = hn::And(wanted, hn::And(spot.inside, hasBrick(spot.entry)));
  if (hn::AllFalse(kF, sampled)) return bound;
  Whole brick = spot.entry;
  const Mask refined = isRefined(spot);
  if (!hn::AllFalse(kF, refined)) {
    brick = hn::IfThenElse(asWholeMask(refined), childrenOf(field, spot, refined).own, brick);
  }
  brick = hn::IfThenElseZero(asWholeMask(sampled), brick);
  const NextSample next = nextSample(field, brick, spot.p_brick);
  const Float closer = hn::Sub(hn::Sub(next.value, norm(next.away)), all(static_cast<float>(kHalfDiagonal)));
  return hn::IfThenElse(sampled, hn::Max(bound, closer), bound);
}

/// Which balls of a block may hold a contact.
HWY_INLINE std::uint32_t reachingBalls(const Field& field, const ShellBlock& balls, bool closer,
                                       Culled& culled) {
  const Float limit = all(field.cull.limit);
  Float smallest = all(culled.smallest_bound);
  std::uint32_t reaching = 0;
  for (std::size_t i = 0; i < balls.count; i += hn::Lanes(kF)) {
    const Mask used = hn::FirstN(kF, balls.count - i);
    const Place3 p = inGrid(field.cull, balls, i);
    const Float radius = hn::Mul(hn::LoadU(kF, balls.radius.data() + i), all(field.cull.per_metre));
    const Spot spot = spotOf(field, p);
    Float bound = farBounds(field, p, spot);
    Mask reaches = hn::And(used, hn::Le(hn::Sub(bound, radius), limit));
    if (closer && !hn::AllFalse(kF, reaches)) {
      bound = closerBounds(field, spot, bound, reaches);
      reaches = hn::And(used, hn::Le(hn::Sub(bound, radius), limit));
    }
    const Float free = hn::IfThenElse(hn::AndNot(reaches, used), hn::Sub(bound, radius), smallest);
    smallest = hn::Min(smallest, free);
    reaching |= bitsOf(reaches) << i;
  }
  culled.spheres += balls.count;
  culled.smallest_bound = hn::GetLane(hn::MinOfLanes(kF, smallest));
  return reaching;
}

std::uint32_t clusters(const LaneFrame& frame, const ShellBlock& balls, Culled& culled) noexcept {
  return reachingBalls(Field(frame), balls, false, culled);
}

void candidates(const LaneFrame& frame, const Pointshell& shell, std::uint32_t cluster, Candidates& out,
                Culled& culled) noexcept {
  const Field field(frame);
  std::uint32_t reaching = reachingBalls(field, shell.leavesOfCluster(cluster), true, culled);
  const std::uint32_t first_leaf = shell.clusters()[cluster].first;
  const Float limit = all(field.cull.limit);
  Float smallest = all(culled.smallest_bound);
  for (; reaching != 0; reaching &= reaching - 1) {
    const std::uint32_t leaf = first_leaf + static_cast<std::uint32_t>(std::countr_zero(reaching));
    const ShellBlock& points = shell.pointsOfLeaf(leaf);
    const std::uint32_t before = out.count;
    for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
      const Mask used = hn::FirstN(kF, points.count - i);
      const Float bound = pointBounds(field, inGrid(field.cull, points, i));
      const Mask near = hn::And(used, hn::Le(bound, limit));
      smallest = hn::Min(smallest, hn::IfThenElse(hn::AndNot(near, used), bound, smallest));
      if (hn::AllFalse(kF, near)) continue;
      const std::uint32_t n = out.count;
      const auto number = hn::Iota(kU, static_cast<std::uint32_t>(shell.leaves()[leaf].first + i));
      hn::StoreU(hn::Compress(hn::LoadU(kF, points.x.data() + i), near), kF, out.x.data() + n);
      hn::StoreU(hn::Compress(hn::LoadU(kF, points.y.data() + i), near), kF, out.y.data() + n);
      hn::StoreU(hn::Compress(hn::LoadU(kF, points.z.data() + i), near), kF, out.z.data() + n);
      hn::StoreU(hn::Compress(number, hn::RebindMask(kU, near)), kU, out.point.data() + n);
      out.count += static_cast<std::uint32_t>(hn::CountTrue(kF, near));
    }
    culled.points += points.count;
    if (out.count > before) out.leaf_end[out.leaves++] = static_cast<std::uint16_t>(out.count);
  }
  culled.smallest_bound = hn::GetLane(hn::MinOfLanes(kF, smallest));
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
