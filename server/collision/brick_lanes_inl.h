// Access to the bricks of a field in single precision. Included once for every instruction set, before
// cull_lanes_inl.h.

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
namespace tenon::collision {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Lengths are in voxels, positions relative to the centre of the grid's first voxel (see CullFrame).
namespace cull {

constexpr HWY_CAPPED(float, 16) kF;
constexpr hn::Rebind<std::int32_t, decltype(kF)> kI;
constexpr hn::Rebind<std::uint32_t, decltype(kF)> kU;
using Float = hn::Vec<decltype(kF)>;
using Int = hn::Vec<decltype(kI)>;
using UInt = hn::Vec<decltype(kU)>;
using Mask = hn::Mask<decltype(kF)>;

constexpr int kVoxels = structures::DistanceField::kBrickVoxels;
constexpr int kSide = structures::DistanceField::kBrickSide;
constexpr auto kHalfDiagonal = static_cast<float>(structures::DistanceField::kHalfDiagonal);

HWY_INLINE Float splat(float value) { return hn::Set(kF, value); }
HWY_INLINE Int splatInt(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Float toFloat(Int v) { return hn::ConvertTo(kF, v); }
HWY_INLINE Mask asMask(hn::Mask<decltype(kI)> mask) { return hn::RebindMask(kF, mask); }
HWY_INLINE hn::Mask<decltype(kI)> asIntMask(Mask mask) { return hn::RebindMask(kI, mask); }

HWY_INLINE Mask hasBrick(Int entry) { return asMask(hn::Gt(entry, splatInt(-1))); }
HWY_INLINE Mask isFarInside(Int entry) {
  return asMask(hn::Eq(entry, splatInt(structures::DistanceField::kFarInside)));
}
HWY_INLINE Mask isRefined(Int entry) {
  return asMask(hn::Gt(entry, splatInt(structures::DistanceField::kRefined - 1)));
}
HWY_INLINE Int zeroUnless(Mask mask, Int v) { return hn::IfThenElseZero(asIntMask(mask), v); }

HWY_INLINE std::uint32_t bitsOf(Mask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(kF, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8U;
}

struct Vec3 {
  Float x, y, z;
};

HWY_INLINE Float sum3(Float a, Float b, Float c) { return hn::Add(hn::Add(a, b), c); }
HWY_INLINE Float norm(const Vec3& v) {
  return hn::Sqrt(sum3(hn::Mul(v.x, v.x), hn::Mul(v.y, v.y), hn::Mul(v.z, v.z)));
}

/// Field and frame as culling reads them; copies, so that the compiler knows that no store changes them.
struct CullField {
  explicit CullField(const LaneFrame& frame)
      : cull(frame.cull),
        row(frame.field.layout().bricks[0]),
        layer(row * frame.field.layout().bricks[1]),
        refinement(frame.field.layout().refinement),
        last_far_pair(static_cast<std::int32_t>(2 * frame.field.layout().far.size() - 4)),
        index(frame.field.layout().index.data()),
        samples(reinterpret_cast<const std::int32_t*>(frame.field.layout().samples.data())),
        far(reinterpret_cast<const std::int32_t*>(frame.field.layout().far.data())) {}

  const CullFrame cull;
  const std::int32_t row, layer;  ///< index step to the next brick along y and z
  const std::int32_t refinement;
  const std::int32_t last_far_pair;  ///< [bytes] offset of the last pair of values
  const structures::DistanceField::Entry* const index;
  const std::int32_t* const samples;  ///< gathered at byte offsets, two int16 samples at a time
  const std::int32_t* const far;      ///< likewise
};

/// Points of a block in grid coordinates.
HWY_INLINE Vec3 inGrid(const CullFrame& cull, const structures::ShellBlock& block, std::size_t i) {
  const Float x = hn::LoadU(kF, block.x.data() + i);
  const Float y = hn::LoadU(kF, block.y.data() + i);
  const Float z = hn::LoadU(kF, block.z.data() + i);
  const auto row = [&](std::size_t k) HWY_ATTR {
    return hn::Add(splat(cull.p[k]), sum3(hn::Mul(splat(cull.R[k]), x), hn::Mul(splat(cull.R[3 + k]), y),
                                          hn::Mul(splat(cull.R[6 + k]), z)));
  };
  return {row(0), row(1), row(2)};
}

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE Float clamped(Float p, Float last_voxel) {
  const float low = p.raw > 0.0F ? p.raw : 0.0F;
  return Float(low < last_voxel.raw ? low : last_voxel.raw);
}
#else
HWY_INLINE Float clamped(Float p, Float last_voxel) { return hn::Min(hn::Max(p, hn::Zero(kF)), last_voxel); }
#endif

/// A coordinate along one axis, clamped to the voxel centres 0 to `last_voxel`: index of its voxel and offset
/// from the voxel's centre, -0.5 to 0.5.
struct AxisVoxel {
  Int voxel;
  Float from_centre;
};

HWY_INLINE AxisVoxel splitAxis(Float p, Float last_voxel) {
  // adding this constant leaves p, rounded to an integer, in the lowest bits of the mantissa
  constexpr float kRoundToInt = 12582912.0F;  // 1.5 * 2^23
  constexpr std::int32_t kVoxelMask = CullFrame::kMaxVoxels - 1;
  p = clamped(p, last_voxel);
  const Float sum = hn::Add(p, splat(kRoundToInt));
  return {hn::And(hn::BitCast(kI, sum), splatInt(kVoxelMask)), hn::Sub(p, hn::Sub(sum, splat(kRoundToInt)))};
}

/// A position in a brick.
struct BrickPoint {
  Int x, y, z;  ///< index of the voxel, 0 to 7
  Vec3 from_centre;
};

/// A position in the grid.
struct VoxelLocation {
  Int brick_index;  ///< in DistanceField::Layout::index
  Int entry;        ///< the index entry there
  BrickPoint at;
};

/// Positions outside the grid are clamped to its border. Bounds stay valid: the whole surface is inside the
/// grid, so it is farther from the position than from the border.
HWY_INLINE VoxelLocation locateVoxel(const CullField& field, const Vec3& p) {
  const auto& last_voxel = field.cull.last_voxel;
  const AxisVoxel x = splitAxis(p.x, splat(last_voxel[0]));
  const AxisVoxel y = splitAxis(p.y, splat(last_voxel[1]));
  const AxisVoxel z = splitAxis(p.z, splat(last_voxel[2]));
  const Int in_brick = splatInt(kVoxels - 1);
  VoxelLocation location;
  location.at = {hn::And(x.voxel, in_brick),
                 hn::And(y.voxel, in_brick),
                 hn::And(z.voxel, in_brick),
                 {x.from_centre, y.from_centre, z.from_centre}};
  const auto brick = [](Int voxel) HWY_ATTR { return hn::ShiftRight<3>(voxel); };
  location.brick_index = hn::Add(
      hn::Add(hn::Mul(brick(z.voxel), splatInt(field.layer)), hn::Mul(brick(y.voxel), splatInt(field.row))),
      brick(x.voxel));
  location.entry = hn::GatherIndex(kI, field.index, location.brick_index);
  return location;
}

/// The two samples along x, on the row of samples nearest to a position, that the position lies between.
struct SampleRow {
  Int offset;      ///< [bytes] of the first of them, from the brick's first sample
  Float fraction;  ///< position between them, 0 to 1
};

HWY_INLINE SampleRow nearestRow(const BrickPoint& at) {
  // samples are at the voxel corners: the upper one, or the lower one for positions below the voxel's centre
  const auto nearest = [](Int voxel, Float from_centre) HWY_ATTR {
    return hn::Add(voxel, hn::ShiftRight<31>(hn::BitCast(kI, from_centre)));
  };
  const Int y = nearest(at.y, at.from_centre.y);
  const Int z = nearest(at.z, at.from_centre.z);
  const auto timesNine = [](Int v) HWY_ATTR { return hn::Add(hn::ShiftLeft<3>(v), v); };
  static_assert(kSide == 9);
  constexpr std::int32_t kUpper = kSide * kSide + kSide;
  const Int sample = hn::Add(timesNine(hn::Add(timesNine(z), y)), hn::Add(at.x, splatInt(kUpper)));
  return {hn::ShiftLeft<1>(sample), hn::Add(at.from_centre.x, splat(0.5F))};
}

/// [voxels] Distance interpolated along the row.
HWY_INLINE Float interpolateRow(const CullField& field, Int brick, const SampleRow& row) {
  const Int first_sample = hn::Mul(brick, splatInt(2 * structures::DistanceField::kBrickSamples));
  const Int pair = hn::GatherOffset(kI, field.samples, hn::Add(first_sample, row.offset));
  const Int first = hn::ShiftRight<16>(hn::ShiftLeft<16>(pair));
  const Int rise = hn::Sub(hn::ShiftRight<16>(pair), first);
  constexpr float kPerQuantum = 1.0F / structures::DistanceField::kQuantaPerVoxel;
  return hn::Mul(hn::Add(toFloat(first), hn::Mul(toFloat(rise), row.fraction)), splat(kPerQuantum));
}

/// [voxels] DistanceField::Layout::far: bound for the centre of a brick.
HWY_INLINE Float farBound(const CullField& field, Int brick_index) {
  // gathers read two values at a time: the last value is the upper half of the pair that ends there
  const Int last = splatInt(field.last_far_pair);
  const Int offset = hn::ShiftLeft<1>(brick_index);
  const Int pair = hn::GatherOffset(kI, field.far, hn::Min(offset, last));
  const Int upper = hn::IfThenElse(hn::Gt(offset, last), pair, hn::ShiftLeft<16>(pair));
  return hn::Mul(toFloat(hn::ShiftRight<16>(upper)), splat(1.0F / structures::DistanceField::kFarPerVoxel));
}

/// Index entries of a refined brick: of the child at a position, and of its own coarse samples.
struct Children {
  Int fine, own;
  BrickPoint at;  ///< in the child
};

HWY_INLINE Children locateChildren(const CullField& field, const VoxelLocation& location, Mask refined) {
  const std::int32_t r = field.refinement;
  const auto splitFineAxis = [&](Int voxel, Float from_centre) HWY_ATTR {
    const Float p = hn::Add(hn::Add(toFloat(voxel), from_centre), splat(0.5F));
    return splitAxis(hn::Sub(hn::Mul(p, splat(static_cast<float>(r))), splat(0.5F)),
                     splat(static_cast<float>(r * kVoxels - 1)));
  };
  const AxisVoxel x = splitFineAxis(location.at.x, location.at.from_centre.x);
  const AxisVoxel y = splitFineAxis(location.at.y, location.at.from_centre.y);
  const AxisVoxel z = splitFineAxis(location.at.z, location.at.from_centre.z);
  const auto brick = [](Int voxel) HWY_ATTR { return hn::ShiftRight<3>(voxel); };
  const Int in_brick = splatInt(kVoxels - 1);
  // lanes that are not refined read entry 0, which is not used
  const Int first =
      zeroUnless(refined, hn::Sub(location.entry, splatInt(structures::DistanceField::kRefined)));
  const Int child = hn::Add(
      hn::Mul(hn::Add(hn::Mul(brick(z.voxel), splatInt(r)), brick(y.voxel)), splatInt(r)), brick(x.voxel));
  const Int fine = zeroUnless(refined, hn::Add(first, child));
  const Int own = zeroUnless(refined, hn::Add(first, splatInt(r * r * r)));
  return {hn::GatherIndex(kI, field.index, fine),
          hn::GatherIndex(kI, field.index, own),
          {hn::And(x.voxel, in_brick),
           hn::And(y.voxel, in_brick),
           hn::And(z.voxel, in_brick),
           {x.from_centre, y.from_centre, z.from_centre}}};
}

}  // namespace cull
}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#endif
