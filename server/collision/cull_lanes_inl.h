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
constexpr auto kHalfDiagonal = static_cast<float>(DistanceField::kHalfDiagonal);

HWY_INLINE Float all(float value) { return hn::Set(kF, value); }
HWY_INLINE Whole allWhole(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Float toFloat(Whole v) { return hn::ConvertTo(kF, v); }
#if HWY_TARGET == HWY_SCALAR
// all values are in range: what is outside the grid stands at its corner
HWY_INLINE Whole truncated(Float v) { return Whole(static_cast<std::int32_t>(v.raw)); }
#else
HWY_INLINE Whole truncated(Float v) { return hn::ConvertTo(kI, v); }
#endif
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

HWY_INLINE Place3 inGrid(const CullFrame& cull, const Place3& p_A) {
  const auto row = [&](std::size_t k) HWY_ATTR {
    return hn::Add(all(cull.p[k]), sum3(hn::Mul(all(cull.R[k]), p_A.x), hn::Mul(all(cull.R[3 + k]), p_A.y),
                                        hn::Mul(all(cull.R[6 + k]), p_A.z)));
  };
  return {row(0), row(1), row(2)};
}

HWY_INLINE Place3 inGrid(const CullFrame& cull, const ShellBlock& block, std::size_t i) {
  return inGrid(cull, {hn::LoadU(kF, block.x.data() + i), hn::LoadU(kF, block.y.data() + i),
                       hn::LoadU(kF, block.z.data() + i)});
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
  spot.number =
      hn::Add(hn::Add(hn::Mul(bz, allWhole(bricks[0] * bricks[1])), hn::Mul(by, allWhole(bricks[0]))), bx);
  spot.entry = hn::GatherIndex(kI, field.layout.index.data(), spot.number);
  return spot;
}

/// The sample next to a place in a brick, and the way from there along each axis, 0 to 0.5.
struct NextSample {
  Whole place;  ///< in bytes, of the pair that it is in
  hn::Mask<decltype(kI)> upper;
  Place3 away;
};

HWY_INLINE NextSample nextSample(Whole brick, const Place3& p_brick) {
  const Float half = all(0.5F);
  const Whole x = truncated(hn::Add(p_brick.x, half));
  const Whole y = truncated(hn::Add(p_brick.y, half));
  const Whole z = truncated(hn::Add(p_brick.z, half));
  // the last along x is the upper half of the pair before it
  const Whole last = allWhole(kVoxels - 1);
  const Whole row = hn::Add(hn::Mul(z, allWhole(kSide * kSide)), hn::Mul(y, allWhole(kSide)));
  const Whole pair = hn::Add(row, hn::Min(x, last));
  const Whole first = hn::Mul(brick, allWhole(DistanceField::kBrickSamples));
  return {hn::ShiftLeft<1>(hn::Add(first, pair)),
          hn::Gt(x, last),
          {hn::Abs(hn::Sub(p_brick.x, toFloat(x))), hn::Abs(hn::Sub(p_brick.y, toFloat(y))),
           hn::Abs(hn::Sub(p_brick.z, toFloat(z)))}};
}

HWY_INLINE Float valueOf(const Field& field, const NextSample& next) {
  const Whole pair = hn::GatherOffset(kI, field.samples, next.place);
  const Whole upper = hn::IfThenElse(next.upper, pair, hn::ShiftLeft<16>(pair));
  constexpr float kPerQuantum = 1.0F / DistanceField::kQuantaPerVoxel;
  return hn::Mul(toFloat(hn::ShiftRight<16>(upper)), all(kPerQuantum));
}

/// For a point: the corners of its cell lie sqrt(1), sqrt(2) or sqrt(3) from the next sample, and weighted as
/// the interpolation does their mean is at most the root of the mean square.
HWY_INLINE Float lossOfPoint(const NextSample& next) {
  return hn::Sqrt(sum3(next.away.x, next.away.y, next.away.z));
}
HWY_INLINE Float boundOfPoint(const Field& field, Whole brick, const Place3& p_brick) {
  const NextSample next = nextSample(brick, p_brick);
  return hn::Sub(valueOf(field, next), lossOfPoint(next));
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

/// Of points in a field with refined bricks: a child answers in its band, its coarse brick beyond, and
/// neither may be near.
HWY_INLINE Float boundsAmongChildren(const Field& field, const Spot& spot, Mask sampled, Mask refined) {
  const Children children = childrenOf(field, spot, refined);
  const Whole own = hn::IfThenElse(asWholeMask(refined), children.own,
                                   hn::IfThenElseZero(asWholeMask(sampled), spot.entry));
  const Float bound = boundOfPoint(field, own, spot.p_brick);
  const Mask has_fine = hn::And(refined, hasBrick(children.fine));
  const Whole fine = hn::IfThenElseZero(asWholeMask(has_fine), children.fine);
  const Float fine_voxel = all(1.0F / static_cast<float>(field.layout.refinement));
  const Float fine_bound = hn::Mul(boundOfPoint(field, fine, children.p_fine), fine_voxel);
  return hn::IfThenElse(has_fine, hn::Min(bound, fine_bound), bound);
}

/// What is known of a point before its sample is read: the bound is the sample minus the loss, or `least` if
/// that is more.
struct Prospect {
  NextSample next;
  Float loss, least;
};

HWY_INLINE Prospect prospectOf(const Field& field, const Place3& p) {
  const Float none = all(-1e9F);
  const Spot spot = spotOf(field, p);
  const Mask deep = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarInside)));
  Prospect out;
  out.least = hn::IfThenElse(deep, none, all(field.cull.beyond_band));
  out.least = hn::IfThenElse(spot.inside, out.least, all(field.cull.outside));
  Mask sampled = hn::And(spot.inside, hasBrick(spot.entry));
  const Mask refined = isRefined(spot);
  if (hn::AllFalse(kF, refined)) {
    out.least = hn::IfThenElse(sampled, none, out.least);
  } else {
    out.least = hn::IfThenElse(sampled, boundsAmongChildren(field, spot, sampled, refined), out.least);
    sampled = hn::FirstN(kF, 0);
  }
  out.next = nextSample(hn::IfThenElseZero(asWholeMask(sampled), spot.entry), spot.p_brick);
  out.loss = hn::IfThenElse(sampled, lossOfPoint(out.next), all(1e9F));
  return out;
}

HWY_INLINE Float farOf(const Field& field, Whole number) {
  // two at a time: the last is the upper half of the pair before it
  const Whole last = allWhole(static_cast<std::int32_t>(2 * field.layout.far.size() - 4));
  const Whole wanted = hn::ShiftLeft<1>(number);
  const Whole pair = hn::GatherOffset(kI, field.far, hn::Min(wanted, last));
  const Whole upper = hn::IfThenElse(hn::Gt(wanted, last), pair, hn::ShiftLeft<16>(pair));
  return hn::Mul(toFloat(hn::ShiftRight<16>(upper)), all(1.0F / DistanceField::kFarPerVoxel));
}

/// A value's bound over a ball of radius r whose centre is `away` from where the value is: a point of the
/// ball takes its mean from corners about it, whose squares lie up to three quarters further in the mean.
HWY_INLINE Float boundOfBall(Float value, Float away, Float r) {
  const Float farthest = hn::Add(away, r);
  return hn::Sub(value, hn::Sqrt(hn::Add(hn::Mul(farthest, farthest), all(kHalfDiagonal * kHalfDiagonal))));
}

/// Of balls whose centres are outside the grid, or whose centres' bricks have no samples.
HWY_INLINE Float boundsApart(const Field& field, const Place3& p, const Spot& spot, Float r) {
  const Mask deep = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarInside)));
  const Float beyond_band =
      boundOfBall(all(static_cast<float>(DistanceField::kBandVoxels)), all(kHalfDiagonal), r);
  const Float bound = hn::IfThenElse(deep, all(-1e9F), beyond_band);
  if (hn::AllTrue(kF, spot.inside)) return bound;
  const auto& end = field.cull.end;
  const Float zero = hn::Zero(kF);
  const Place3 beyond{hn::Max(hn::Max(hn::Neg(p.x), hn::Sub(p.x, all(end[0]))), zero),
                      hn::Max(hn::Max(hn::Neg(p.y), hn::Sub(p.y, all(end[1]))), zero),
                      hn::Max(hn::Max(hn::Neg(p.z), hn::Sub(p.z, all(end[2]))), zero)};
  const Float to_surface = hn::Add(norm(beyond), all(field.cull.outside));
  return hn::IfThenElse(spot.inside, bound, boundOfBall(to_surface, zero, r));
}

/// By the middle of the centre's brick, as DistanceField::lowerBound.
HWY_INLINE Float boundsByBrick(const Field& field, const Spot& spot, Float r) {
  const Float middle = all(0.5F * kVoxels);
  const Float from_middle = norm(
      {hn::Sub(spot.p_brick.x, middle), hn::Sub(spot.p_brick.y, middle), hn::Sub(spot.p_brick.z, middle)});
  return boundOfBall(farOf(field, spot.number), from_middle, r);
}

/// By the sample next to the centre, of lanes whose brick has some.
HWY_INLINE Float boundsBySample(const Field& field, const Spot& spot, Mask sampled, Float r) {
  Whole brick = spot.entry;
  const Mask refined = isRefined(spot);
  if (!hn::AllFalse(kF, refined)) {
    brick = hn::IfThenElse(asWholeMask(refined), childrenOf(field, spot, refined).own, brick);
  }
  const NextSample next = nextSample(hn::IfThenElseZero(asWholeMask(sampled), brick), spot.p_brick);
  return boundOfBall(valueOf(field, next), norm(next.away), r);
}

/// `closely`: also by the sample next to the centre, where the brick's middle does not tell.
template <bool closely>
HWY_INLINE Float boundsOfBalls(const Field& field, const Place3& p, Float r, Mask used) {
  const Spot spot = spotOf(field, p);
  const Mask sampled = hn::And(spot.inside, hasBrick(spot.entry));
  const Mask deep = asMask(hn::Eq(spot.entry, allWhole(DistanceField::kFarInside)));
  const Float by_brick = boundsByBrick(field, spot, r);
  Float bound = boundsApart(field, p, spot, r);
  bound = hn::IfThenElse(hn::And(spot.inside, hn::Not(deep)), hn::Max(bound, by_brick), bound);
  bound = hn::IfThenElse(sampled, by_brick, bound);
  if constexpr (!closely) return bound;
  const Mask wanted = hn::And(hn::And(used, sampled), hn::Le(bound, all(field.cull.limit)));
  if (hn::AllFalse(kF, wanted)) return bound;
  return hn::IfThenElse(wanted, hn::Max(bound, boundsBySample(field, spot, sampled, r)), bound);
}

/// What was left out, lane by lane.
struct LeftOut {
  explicit LeftOut(Culled& the_culled) : culled(the_culled), smallest(all(the_culled.smallest_bound)) {}
  ~LeftOut() { culled.smallest_bound = hn::GetLane(hn::MinOfLanes(kF, smallest)); }
  LeftOut(const LeftOut&) = delete;
  LeftOut& operator=(const LeftOut&) = delete;

  HWY_INLINE void add(Mask lanes, Float bound) {
    smallest = hn::Min(smallest, hn::IfThenElse(lanes, bound, smallest));
  }

  Culled& culled;
  Float smallest;
};

/// Which balls of a block may hold a contact.
template <bool closely>
HWY_INLINE std::uint32_t reachingBalls(const Field& field, const ShellBlock& balls, LeftOut& left_out) {
  const Float limit = all(field.cull.limit);
  std::uint32_t reaching = 0;
  for (std::size_t i = 0; i < balls.count; i += hn::Lanes(kF)) {
    const Mask used = hn::FirstN(kF, balls.count - i);
    const Float radius = hn::Mul(hn::LoadU(kF, balls.radius.data() + i), all(field.cull.per_metre));
    const Float bound = boundsOfBalls<closely>(field, inGrid(field.cull, balls, i), radius, used);
    const Mask reaches = hn::And(used, hn::Le(bound, limit));
    left_out.add(hn::AndNot(reaches, used), bound);
    reaching |= bitsOf(reaches) << i;
  }
  left_out.culled.spheres += balls.count;
  return reaching;
}

std::uint32_t clusters(const LaneFrame& frame, const ShellBlock& balls, Culled& culled) noexcept {
  LeftOut left_out(culled);
  return reachingBalls<false>(Field(frame), balls, left_out);
}

/// Points of leaves that reach, side by side.
struct Gathered {
  template <typename T>
  using Lanes = std::array<T, Candidates::kAtOnce + ShellBlock::kLanes>;  ///< whole vectors are read

  alignas(64) Lanes<float> x, y, z;
  Lanes<std::uint32_t> point;
  std::size_t count = 0;

  /// All sixteen lanes are written, those in use count.
  HWY_INLINE void add(const Pointshell& shell, std::uint32_t leaf) {
    const ShellBlock& points = shell.pointsOfLeaf(leaf);
    const std::uint32_t first = shell.leaves()[leaf].first;
    for (std::size_t i = 0; i < ShellBlock::kLanes; i += hn::Lanes(kF)) {
      hn::StoreU(hn::Load(kF, points.x.data() + i), kF, x.data() + count + i);
      hn::StoreU(hn::Load(kF, points.y.data() + i), kF, y.data() + count + i);
      hn::StoreU(hn::Load(kF, points.z.data() + i), kF, z.data() + count + i);
      hn::StoreU(hn::Iota(kU, first + static_cast<std::uint32_t>(i)), kU, point.data() + count + i);
    }
    count += points.count;
  }
};

/// Appends the lanes from i that are near.
HWY_INLINE void append(const Gathered& points, std::size_t i, Mask near, Candidates& out) {
#if HWY_TARGET <= HWY_AVX3
  const std::uint32_t n = out.count;
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.x.data() + i), near), kF, out.x.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.y.data() + i), near), kF, out.y.data() + n);
  hn::StoreU(hn::Compress(hn::LoadU(kF, points.z.data() + i), near), kF, out.z.data() + n);
  const auto number = hn::LoadU(kU, points.point.data() + i);
  hn::StoreU(hn::Compress(number, hn::RebindMask(kU, near)), kU, out.point.data() + n);
  out.count += static_cast<std::uint32_t>(hn::CountTrue(kF, near));
#else
  for (std::uint32_t bits = bitsOf(near); bits != 0; bits &= bits - 1) {
    const std::size_t lane = i + static_cast<std::size_t>(std::countr_zero(bits));
    out.x[out.count] = points.x[lane];
    out.y[out.count] = points.y[lane];
    out.z[out.count] = points.z[lane];
    out.point[out.count++] = points.point[lane];
  }
#endif
}

/// In two rounds: reading samples is waiting for memory, and for many of them at once in a short loop.
HWY_INLINE void appendNear(const Field& field, const Gathered& points, Candidates& out, LeftOut& left_out) {
  struct Prospects {
    alignas(64) Gathered::Lanes<std::int32_t> place, upper;
    Gathered::Lanes<float> loss, least;
  } wait;
  for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
    const Place3 p_A{hn::LoadU(kF, points.x.data() + i), hn::LoadU(kF, points.y.data() + i),
                     hn::LoadU(kF, points.z.data() + i)};
    const Prospect one = prospectOf(field, inGrid(field.cull, p_A));
    hn::StoreU(one.next.place, kI, wait.place.data() + i);
    hn::StoreU(hn::VecFromMask(kI, one.next.upper), kI, wait.upper.data() + i);
    hn::StoreU(one.loss, kF, wait.loss.data() + i);
    hn::StoreU(one.least, kF, wait.least.data() + i);
  }
  const Float limit = all(field.cull.limit);
  for (std::size_t i = 0; i < points.count; i += hn::Lanes(kF)) {
    NextSample next;
    next.place = hn::LoadU(kI, wait.place.data() + i);
    next.upper = hn::MaskFromVec(hn::LoadU(kI, wait.upper.data() + i));
    const Float bound = hn::Max(hn::Sub(valueOf(field, next), hn::LoadU(kF, wait.loss.data() + i)),
                                hn::LoadU(kF, wait.least.data() + i));
    const Mask used = hn::FirstN(kF, points.count - i);
    const Mask near = hn::And(used, hn::Le(bound, limit));
    left_out.add(hn::AndNot(near, used), bound);
    append(points, i, near, out);
  }
  left_out.culled.points += static_cast<std::uint32_t>(points.count);
}

/// Gathers the points of the leaves that reach.
HWY_INLINE void gatherLeaves(const Pointshell& shell, std::uint32_t cluster, std::uint32_t reaching,
                             Gathered& points) {
  const std::uint32_t first_leaf = shell.clusters()[cluster].first;
  for (; reaching != 0; reaching &= reaching - 1) {
    points.add(shell, first_leaf + static_cast<std::uint32_t>(std::countr_zero(reaching)));
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
  Gathered points;
  for (std::size_t i = 0; i < of.size(); ++i) {
    gatherLeaves(shell, of[i], reaching[i], points);
  }
  appendNear(field, points, out, left_out);
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
