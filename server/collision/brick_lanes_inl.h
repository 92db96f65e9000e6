// Places in the bricks of a field, in floats. Included once for every instruction set, before what culls by
// them.

#if defined(TENON_BRICK_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_BRICK_LANES
#undef TENON_BRICK_LANES
#else
#define TENON_BRICK_LANES
#endif

#include <cstdint>

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace tenon {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Everything in voxels, places from the middle of the grid's first voxel.
namespace cull {

constexpr HWY_CAPPED(float, 16) kF;
constexpr hn::Rebind<std::int32_t, decltype(kF)> kI;
constexpr hn::Rebind<std::uint32_t, decltype(kF)> kU;
using Float = hn::Vec<decltype(kF)>;
using Whole = hn::Vec<decltype(kI)>;
using Number = hn::Vec<decltype(kU)>;
using Mask = hn::Mask<decltype(kF)>;

constexpr int kVoxels = DistanceField::kBrickVoxels;
constexpr int kSide = DistanceField::kBrickSide;
constexpr auto kHalfDiagonal = static_cast<float>(DistanceField::kHalfDiagonal);

HWY_INLINE Float all(float value) { return hn::Set(kF, value); }
HWY_INLINE Whole allWhole(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Float toFloat(Whole v) { return hn::ConvertTo(kF, v); }
HWY_INLINE Mask asMask(hn::Mask<decltype(kI)> mask) { return hn::RebindMask(kF, mask); }
HWY_INLINE hn::Mask<decltype(kI)> asWholeMask(Mask mask) { return hn::RebindMask(kI, mask); }

HWY_INLINE Mask hasBrick(Whole entry) { return asMask(hn::Gt(entry, allWhole(-1))); }
HWY_INLINE Mask isDeep(Whole entry) { return asMask(hn::Eq(entry, allWhole(DistanceField::kFarInside))); }
HWY_INLINE Mask isRefined(Whole entry) {
  return asMask(hn::Gt(entry, allWhole(DistanceField::kRefined - 1)));
}
HWY_INLINE Whole whereSet(Mask mask, Whole v) { return hn::IfThenElseZero(asWholeMask(mask), v); }

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

/// Field and frame as culling reads them; copies, so that no store seems to change them.
struct Field {
  explicit Field(const LaneFrame& frame)
      : cull(frame.cull),
        row(frame.field.layout().bricks[0]),
        layer(row * frame.field.layout().bricks[1]),
        refinement(frame.field.layout().refinement),
        last_far(static_cast<std::int32_t>(2 * frame.field.layout().far.size() - 4)),
        index(frame.field.layout().index.data()),
        samples(reinterpret_cast<const std::int32_t*>(frame.field.layout().samples.data())),
        far(reinterpret_cast<const std::int32_t*>(frame.field.layout().far.data())) {}

  const CullFrame cull;
  const std::int32_t row, layer;  ///< bricks to the next one along y and z
  const std::int32_t refinement;
  const std::int32_t last_far;  ///< [bytes] where the last pair is
  const DistanceField::Entry* const index;
  const std::int32_t* const samples;  ///< read at byte offsets, two samples at a time
  const std::int32_t* const far;
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

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE Float clamped(Float p, Float most) {
  const float low = p.raw > 0.0F ? p.raw : 0.0F;
  return Float(low < most.raw ? low : most.raw);
}
#else
HWY_INLINE Float clamped(Float p, Float most) { return hn::Min(hn::Max(p, hn::Zero(kF)), most); }
#endif

/// A place along one axis: the voxel that it is in, and the way from the voxel's middle, -0.5 to 0.5. What is
/// below 0 or above `most` stands there.
struct Along {
  Whole voxel;
  Float from_middle;
};

HWY_INLINE Along along(Float p, Float most) {
  // a sum with this has the whole part of p, rounded, in its lowest bits
  constexpr float kRounding = 12582912.0F;  // 1.5 * 2^23
  constexpr std::int32_t kBits = CullFrame::kMostVoxels - 1;
  p = clamped(p, most);
  const Float sum = hn::Add(p, all(kRounding));
  return {hn::And(hn::BitCast(kI, sum), allWhole(kBits)), hn::Sub(p, hn::Sub(sum, all(kRounding)))};
}

/// A place in a brick.
struct InBrick {
  Whole x, y, z;  ///< the voxel, 0 to 7
  Place3 from_middle;
};

struct Spot {
  Whole number, entry;  ///< of the brick
  InBrick at;
};

/// What is outside the grid stands at its border: all surface is inside, and farther from there.
HWY_INLINE Spot spotOf(const Field& field, const Place3& p) {
  const auto& most = field.cull.most;
  const Along x = along(p.x, all(most[0]));
  const Along y = along(p.y, all(most[1]));
  const Along z = along(p.z, all(most[2]));
  const Whole in_brick = allWhole(kVoxels - 1);
  Spot spot;
  spot.at = {hn::And(x.voxel, in_brick),
             hn::And(y.voxel, in_brick),
             hn::And(z.voxel, in_brick),
             {x.from_middle, y.from_middle, z.from_middle}};
  const auto brick = [](Whole voxel) HWY_ATTR { return hn::ShiftRight<3>(voxel); };
  spot.number = hn::Add(
      hn::Add(hn::Mul(brick(z.voxel), allWhole(field.layer)), hn::Mul(brick(y.voxel), allWhole(field.row))),
      brick(x.voxel));
  spot.entry = hn::GatherIndex(kI, field.index, spot.number);
  return spot;
}

/// The row of samples along x next to a place: the pair that the place is between, and how far from the
/// first of them it is.
struct Row {
  Whole place;  ///< in bytes from the brick's first sample
  Float along;
};

HWY_INLINE Row rowOf(const InBrick& at) {
  // the upper one, or one less where the place is below the middle
  const auto nearest = [](Whole voxel, Float from_middle) HWY_ATTR {
    return hn::Add(voxel, hn::ShiftRight<31>(hn::BitCast(kI, from_middle)));
  };
  const Whole y = nearest(at.y, at.from_middle.y);
  const Whole z = nearest(at.z, at.from_middle.z);
  const auto nine = [](Whole v) HWY_ATTR { return hn::Add(hn::ShiftLeft<3>(v), v); };
  static_assert(kSide == 9);
  constexpr std::int32_t kUpper = kSide * kSide + kSide;
  const Whole sample = hn::Add(nine(hn::Add(nine(z), y)), hn::Add(at.x, allWhole(kUpper)));
  return {hn::ShiftLeft<1>(sample), hn::Add(at.from_middle.x, all(0.5F))};
}

HWY_INLINE Float valueOf(const Field& field, Whole brick, const Row& row) {
  const Whole first_sample = hn::Mul(brick, allWhole(2 * DistanceField::kBrickSamples));
  const Whole pair = hn::GatherOffset(kI, field.samples, hn::Add(first_sample, row.place));
  const Whole first = hn::ShiftRight<16>(hn::ShiftLeft<16>(pair));
  const Whole rise = hn::Sub(hn::ShiftRight<16>(pair), first);
  constexpr float kPerQuantum = 1.0F / DistanceField::kQuantaPerVoxel;
  return hn::Mul(hn::Add(toFloat(first), hn::Mul(toFloat(rise), row.along)), all(kPerQuantum));
}

HWY_INLINE Float farOf(const Field& field, Whole number) {
  // two at a time: the last is the upper half of the pair before it
  const Whole last = allWhole(field.last_far);
  const Whole wanted = hn::ShiftLeft<1>(number);
  const Whole pair = hn::GatherOffset(kI, field.far, hn::Min(wanted, last));
  const Whole upper = hn::IfThenElse(hn::Gt(wanted, last), pair, hn::ShiftLeft<16>(pair));
  return hn::Mul(toFloat(hn::ShiftRight<16>(upper)), all(1.0F / DistanceField::kFarPerVoxel));
}

/// The bricks behind refined entries: a child, and the coarse brick itself.
struct Children {
  Whole fine, own;
  InBrick at;  ///< in the child
};

HWY_INLINE Children childrenOf(const Field& field, const Spot& spot, Mask refined) {
  const std::int32_t r = field.refinement;
  const auto fine_along = [&](Whole voxel, Float from_middle) HWY_ATTR {
    const Float p = hn::Add(hn::Add(toFloat(voxel), from_middle), all(0.5F));
    return along(hn::Sub(hn::Mul(p, all(static_cast<float>(r))), all(0.5F)),
                 all(static_cast<float>(r * kVoxels - 1)));
  };
  const Along x = fine_along(spot.at.x, spot.at.from_middle.x);
  const Along y = fine_along(spot.at.y, spot.at.from_middle.y);
  const Along z = fine_along(spot.at.z, spot.at.from_middle.z);
  const auto brick = [](Whole voxel) HWY_ATTR { return hn::ShiftRight<3>(voxel); };
  const Whole in_brick = allWhole(kVoxels - 1);
  // lanes without children read any entry
  const Whole first = whereSet(refined, hn::Sub(spot.entry, allWhole(DistanceField::kRefined)));
  const Whole child = hn::Add(
      hn::Mul(hn::Add(hn::Mul(brick(z.voxel), allWhole(r)), brick(y.voxel)), allWhole(r)), brick(x.voxel));
  const Whole fine = whereSet(refined, hn::Add(first, child));
  const Whole own = whereSet(refined, hn::Add(first, allWhole(r * r * r)));
  return {hn::GatherIndex(kI, field.index, fine),
          hn::GatherIndex(kI, field.index, own),
          {hn::And(x.voxel, in_brick),
           hn::And(y.voxel, in_brick),
           hn::And(z.voxel, in_brick),
           {x.from_middle, y.from_middle, z.from_middle}}};
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
