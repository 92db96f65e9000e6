// Kernels of DistanceField::sample in double precision, with the same bits. Included once for every
// instruction set.

#if defined(TENON_SAMPLE_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_SAMPLE_LANES
#undef TENON_SAMPLE_LANES
#else
#define TENON_SAMPLE_LANES
#endif

#include <algorithm>

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace tenon::collision {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

namespace exact {

// lanes are doubles; integers have the same number of lanes at half the width
constexpr HWY_CAPPED(double, 16) kD;
constexpr hn::Rebind<std::int32_t, decltype(kD)> kI;
constexpr hn::Rebind<float, decltype(kD)> kF;
using Double = hn::Vec<decltype(kD)>;
using Int = hn::Vec<decltype(kI)>;
using Mask = hn::Mask<decltype(kD)>;

constexpr int kVoxels = structures::DistanceField::kBrickVoxels;
constexpr int kSide = structures::DistanceField::kBrickSide;
constexpr int kLayer = kSide * kSide;

struct Vec3 {
  Double x, y, z;
};

HWY_INLINE Double splat(double value) { return hn::Set(kD, value); }
HWY_INLINE Int splatInt(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Double toDouble(Int v) { return hn::PromoteTo(kD, v); }
#if HWY_TARGET == HWY_SCALAR
// all values are in range: positions outside the grid are set to its lowest corner
HWY_INLINE Int truncated(Double v) { return Int(static_cast<std::int32_t>(v.raw)); }
#else
HWY_INLINE Int truncated(Double v) { return hn::DemoteTo(kI, v); }
#endif

HWY_INLINE std::uint32_t bitsOf(Mask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(kD, mask, bytes);
  return bytes[0];
}

HWY_INLINE Mask maskOf(std::uint32_t bits) {
  const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(bits)};
  return hn::LoadMaskBits(kD, bytes);
}

HWY_INLINE Double sum3(Double a, Double b, Double c) { return hn::Add(hn::Add(a, b), c); }
HWY_INLINE Double norm(const Vec3& v) {
  return hn::Sqrt(sum3(hn::Mul(v.x, v.x), hn::Mul(v.y, v.y), hn::Mul(v.z, v.z)));
}
HWY_INLINE Vec3 rotated(const double* R, const Vec3& v) {  // R is column-major
  return {sum3(hn::Mul(splat(R[0]), v.x), hn::Mul(splat(R[3]), v.y), hn::Mul(splat(R[6]), v.z)),
          sum3(hn::Mul(splat(R[1]), v.x), hn::Mul(splat(R[4]), v.y), hn::Mul(splat(R[7]), v.z)),
          sum3(hn::Mul(splat(R[2]), v.x), hn::Mul(splat(R[5]), v.y), hn::Mul(splat(R[8]), v.z))};
}
HWY_INLINE Vec3 transformed(const double* p, const double* R, const Vec3& v) {
  const Vec3 Rv = rotated(R, v);
  return {hn::Add(splat(p[0]), Rv.x), hn::Add(splat(p[1]), Rv.y), hn::Add(splat(p[2]), Rv.z)};
}
HWY_INLINE Vec3 loadPoints(const PointLanes& points, std::size_t first) {
  return {hn::PromoteTo(kD, hn::LoadU(kF, points.x + first)),
          hn::PromoteTo(kD, hn::LoadU(kF, points.y + first)),
          hn::PromoteTo(kD, hn::LoadU(kF, points.z + first))};
}

HWY_INLINE Vec3 inB(const LaneFrame& frame, const PointLanes& points, std::size_t first) {
  return transformed(frame.p_BA_B.data(), frame.R_BA.data(), loadPoints(points, first));
}

HWY_INLINE Vec3 gradientOf(const SampleLanes& samples, std::size_t lane) {
  return {hn::Load(kD, samples.gradient_x.data() + lane), hn::Load(kD, samples.gradient_y.data() + lane),
          hn::Load(kD, samples.gradient_z.data() + lane)};
}

/// A field with constants of the kernels.
struct FieldLanes {
  explicit FieldLanes(const LaneFrame& the_frame)
      : frame(the_frame),
        layout(the_frame.field.layout()),
        edge(layout.voxel * kVoxels),
        inverse_edge(1.0 / edge),
        samples(reinterpret_cast<const std::int32_t*>(layout.samples.data())),
        far(reinterpret_cast<const std::int32_t*>(layout.far.data())) {}

  const LaneFrame& frame;
  const structures::DistanceField::Layout& layout;
  double edge, inverse_edge;    ///< [m], [1/m] of a coarse brick
  const std::int32_t* samples;  ///< gathered at byte offsets, two int16 samples at a time
  const std::int32_t* far;      ///< likewise
};

/// DistanceField::locate; lanes outside the grid are set to its lowest corner.
struct Located {
  Mask in_grid;
  Int brick_index, entry;
  Double entry_number;  ///< `entry` as double
  Vec3 p_brick;         ///< position in the brick, 0 to 1
};

HWY_INLINE Double toBricks(Double p, double origin, double inverse_edge) {
  return hn::Mul(hn::Sub(p, splat(origin)), splat(inverse_edge));
}

HWY_INLINE Located locate(const FieldLanes& field, const Vec3& p_B) {
  const Vector3& origin = field.layout.p_MoFo_M;
  const auto& bricks = field.layout.bricks;
  const Double zero = hn::Zero(kD);
  Double x = toBricks(p_B.x, origin[0], field.inverse_edge);
  Double y = toBricks(p_B.y, origin[1], field.inverse_edge);
  Double z = toBricks(p_B.z, origin[2], field.inverse_edge);
  Located at;
  at.in_grid = hn::And(hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, splat(bricks[0]))),
                               hn::And(hn::Ge(y, zero), hn::Lt(y, splat(bricks[1])))),
                       hn::And(hn::Ge(z, zero), hn::Lt(z, splat(bricks[2]))));
  x = hn::IfThenElseZero(at.in_grid, x);
  y = hn::IfThenElseZero(at.in_grid, y);
  z = hn::IfThenElseZero(at.in_grid, z);
  const Int bx = truncated(x);
  const Int by = truncated(y);
  const Int bz = truncated(z);
  at.p_brick = {hn::Sub(x, toDouble(bx)), hn::Sub(y, toDouble(by)), hn::Sub(z, toDouble(bz))};
  at.brick_index = hn::Add(hn::Mul(hn::Add(hn::Mul(bz, splatInt(bricks[1])), by), splatInt(bricks[0])), bx);
  at.entry = hn::GatherIndex(kI, field.layout.index.data(), at.brick_index);
  at.entry_number = toDouble(at.entry);
  return at;
}

HWY_INLINE Double farValue(const FieldLanes& field, Int brick_index) {
  // gathers read two values at a time: the last value is the upper half of the pair that ends there
  const Int last = splatInt(static_cast<std::int32_t>(2 * field.layout.far.size() - 4));
  const Int offset = hn::ShiftLeft<1>(brick_index);
  const Int pair = hn::GatherOffset(kI, field.far, hn::Min(offset, last));
  const Int upper = hn::IfThenElse(hn::Gt(offset, last), pair, hn::ShiftLeft<16>(pair));
  return toDouble(hn::ShiftRight<16>(upper));
}

HWY_INLINE Double fromBrickCentre(const FieldLanes& field, const Vec3& p_brick) {
  const Double half = splat(0.5);
  const Double edge = splat(field.edge);
  return norm({hn::Mul(hn::Sub(p_brick.x, half), edge), hn::Mul(hn::Sub(p_brick.y, half), edge),
               hn::Mul(hn::Sub(p_brick.z, half), edge)});
}

HWY_INLINE Double farMagnitude(const FieldLanes& field, const Located& at) {
  const double voxel = field.layout.voxel;
  const double beyond_band =
      field.layout.band - field.layout.dilation - structures::DistanceField::kHalfDiagonal * voxel;
  const Double at_centre = hn::Div(hn::Mul(hn::Abs(farValue(field, at.brick_index)), splat(voxel)),
                                   splat(structures::DistanceField::kFarPerVoxel));
  return hn::Max(splat(beyond_band), hn::Sub(at_centre, fromBrickCentre(field, at.p_brick)));
}

HWY_INLINE Double distanceBeyond(double low, double high, Double p) {
  return hn::Max(hn::Max(hn::Sub(splat(low), p), hn::Sub(p, splat(high))), hn::Zero(kD));
}

HWY_INLINE Double distanceToGrid(const FieldLanes& field, const Vec3& p) {
  const Eigen::AlignedBox3d& box = field.frame.box_B;
  const double* low = box.min().data();
  const double* high = box.max().data();
  const Vec3 outside{distanceBeyond(low[0], high[0], p.x), distanceBeyond(low[1], high[1], p.y),
                     distanceBeyond(low[2], high[2], p.z)};
  return hn::Add(norm(outside), splat(field.layout.margin));
}

struct Sampled {
  Double distance;
  Vec3 gradient;
  Mask exact;
};

/// DistanceField::interpolate
HWY_INLINE Sampled interpolate(const FieldLanes& field, Int brick, const Vec3& p_brick, Double voxel,
                               Double band) {
  const Double voxels = splat(kVoxels);
  const Double px = hn::Mul(p_brick.x, voxels);
  const Double py = hn::Mul(p_brick.y, voxels);
  const Double pz = hn::Mul(p_brick.z, voxels);
  const Int last = splatInt(kVoxels - 1);
  const Int x = hn::Min(truncated(px), last);
  const Int y = hn::Min(truncated(py), last);
  const Int z = hn::Min(truncated(pz), last);
  const Double u = hn::Sub(px, toDouble(x));
  const Double v = hn::Sub(py, toDouble(y));
  const Double w = hn::Sub(pz, toDouble(z));
  const Int row = hn::Add(hn::Mul(hn::Add(hn::Mul(z, splatInt(kSide)), y), splatInt(kSide)), x);
  const Int offset =
      hn::ShiftLeft<1>(hn::Add(hn::Mul(brick, splatInt(structures::DistanceField::kBrickSamples)), row));

  // each gather reads two neighbours along x
  const Int g00 = hn::GatherOffset(kI, field.samples, offset);
  const Int g10 = hn::GatherOffset(kI, field.samples, hn::Add(offset, splatInt(2 * kSide)));
  const Int g01 = hn::GatherOffset(kI, field.samples, hn::Add(offset, splatInt(2 * kLayer)));
  const Int g11 = hn::GatherOffset(kI, field.samples, hn::Add(offset, splatInt(2 * (kLayer + kSide))));
  const Int s00 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g00));
  const Int s10 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g10));
  const Int s01 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g01));
  const Int s11 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g11));
  const Double d00 = toDouble(hn::Sub(hn::ShiftRight<16>(g00), s00));
  const Double d10 = toDouble(hn::Sub(hn::ShiftRight<16>(g10), s10));
  const Double d01 = toDouble(hn::Sub(hn::ShiftRight<16>(g01), s01));
  const Double d11 = toDouble(hn::Sub(hn::ShiftRight<16>(g11), s11));

  const Double c00 = hn::Add(toDouble(s00), hn::Mul(d00, u));
  const Double c10 = hn::Add(toDouble(s10), hn::Mul(d10, u));
  const Double c01 = hn::Add(toDouble(s01), hn::Mul(d01, u));
  const Double c11 = hn::Add(toDouble(s11), hn::Mul(d11, u));
  const Double e0 = hn::Sub(c10, c00);
  const Double e1 = hn::Sub(c11, c01);
  const Double c0 = hn::Add(c00, hn::Mul(e0, v));
  const Double c1 = hn::Add(c01, hn::Mul(e1, v));
  const Double d0 = hn::Add(d00, hn::Mul(hn::Sub(d10, d00), v));
  const Double d1 = hn::Add(d01, hn::Mul(hn::Sub(d11, d01), v));

  const Double per_quantum = splat(1.0 / structures::DistanceField::kQuantaPerVoxel);
  const Double rise = hn::Sub(c1, c0);
  Sampled out;
  out.distance = hn::Mul(hn::Mul(hn::Add(c0, hn::Mul(rise, w)), per_quantum), voxel);
  out.gradient = {hn::Mul(hn::Add(d0, hn::Mul(hn::Sub(d1, d0), w)), per_quantum),
                  hn::Mul(hn::Add(e0, hn::Mul(hn::Sub(e1, e0), w)), per_quantum), hn::Mul(rise, per_quantum)};
  out.exact = hn::Le(hn::Abs(out.distance), band);
  return out;
}

/// Interpolates in the child of a refined brick where it has samples, else in the coarse brick.
HWY_INLINE Sampled interpolateRefined(const FieldLanes& field, const Located& at, Mask refined) {
  const structures::DistanceField::Layout& layout = field.layout;
  const int r = layout.refinement;
  const Double coarse_voxel = splat(layout.voxel);
  const Double coarse_band = splat(layout.band);
  const Double fine_voxel = splat(layout.voxel / r);
  const Double fine_band = splat(structures::DistanceField::kBandVoxels * (layout.voxel / r));
  const Double rd = splat(r);
  const Double zero = hn::Zero(kD);
  const Vec3 p{hn::Mul(at.p_brick.x, rd), hn::Mul(at.p_brick.y, rd), hn::Mul(at.p_brick.z, rd)};
  const Int last = splatInt(r - 1);
  const Int cx = hn::Min(truncated(p.x), last);
  const Int cy = hn::Min(truncated(p.y), last);
  const Int cz = hn::Min(truncated(p.z), last);
  // lanes that are not refined read entry 0, which is not used
  const Double first =
      hn::IfThenElseZero(refined, hn::Sub(at.entry_number, splat(structures::DistanceField::kRefined)));
  const Int children = truncated(first);
  const Int child = hn::Add(hn::Mul(hn::Add(hn::Mul(cz, splatInt(r)), cy), splatInt(r)), cx);
  const Int child_index = truncated(hn::IfThenElseZero(refined, toDouble(hn::Add(children, child))));
  const Int own_index =
      truncated(hn::IfThenElseZero(refined, toDouble(hn::Add(children, splatInt(r * r * r)))));
  const Double fine = toDouble(hn::GatherIndex(kI, layout.index.data(), child_index));
  const Double own = toDouble(hn::GatherIndex(kI, layout.index.data(), own_index));
  const Mask has_fine = hn::And(refined, hn::Ge(fine, zero));
  const Mask plain = hn::And(hn::Ge(at.entry_number, zero),
                             hn::Lt(at.entry_number, splat(structures::DistanceField::kRefined)));
  const Double coarse = hn::IfThenElse(refined, own, hn::IfThenElseZero(plain, at.entry_number));
  const Vec3 p_child{hn::IfThenElse(has_fine, hn::Sub(p.x, toDouble(cx)), at.p_brick.x),
                     hn::IfThenElse(has_fine, hn::Sub(p.y, toDouble(cy)), at.p_brick.y),
                     hn::IfThenElse(has_fine, hn::Sub(p.z, toDouble(cz)), at.p_brick.z)};
  Sampled out = interpolate(field, truncated(hn::IfThenElse(has_fine, fine, coarse)), p_child,
                            hn::IfThenElse(has_fine, fine_voxel, coarse_voxel),
                            hn::IfThenElse(has_fine, fine_band, coarse_band));
  // beyond the child's narrower band the coarse brick is more accurate
  const Mask use_coarse = hn::AndNot(out.exact, has_fine);
  if (hn::AllFalse(kD, use_coarse)) return out;
  const Sampled coarse_sample = interpolate(field, truncated(coarse), at.p_brick, coarse_voxel, coarse_band);
  out.distance = hn::IfThenElse(use_coarse, coarse_sample.distance, out.distance);
  out.gradient = {hn::IfThenElse(use_coarse, coarse_sample.gradient.x, out.gradient.x),
                  hn::IfThenElse(use_coarse, coarse_sample.gradient.y, out.gradient.y),
                  hn::IfThenElse(use_coarse, coarse_sample.gradient.z, out.gradient.z)};
  out.exact = hn::Or(out.exact, hn::And(use_coarse, coarse_sample.exact));
  return out;
}

/// DistanceField::sample where that is exact; elsewhere the gradient is 0 and the distance is not valid.
HWY_INLINE Sampled sampleInBand(const FieldLanes& field, const Located& at, Mask has_samples) {
  const structures::DistanceField::Layout& layout = field.layout;
  const Mask refined =
      hn::And(at.in_grid, hn::Ge(at.entry_number, splat(structures::DistanceField::kRefined)));
  Sampled out{hn::Zero(kD), {hn::Zero(kD), hn::Zero(kD), hn::Zero(kD)}, has_samples};
  if (!hn::AllFalse(kD, refined)) {
    out = interpolateRefined(field, at, refined);
  } else if (!hn::AllFalse(kD, has_samples)) {
    out = interpolate(field, hn::Max(at.entry, hn::Zero(kI)), at.p_brick, splat(layout.voxel),
                      splat(layout.band));
  }
  out.exact = hn::And(out.exact, has_samples);
  out.gradient = {hn::IfThenElseZero(out.exact, out.gradient.x),
                  hn::IfThenElseZero(out.exact, out.gradient.y),
                  hn::IfThenElseZero(out.exact, out.gradient.z)};
  return out;
}

HWY_INLINE Mask hasSamples(const Located& at) {
  return hn::And(at.in_grid, hn::Ge(at.entry_number, hn::Zero(kD)));
}

/// DistanceField::sample
HWY_INLINE Sampled sample(const FieldLanes& field, const PointLanes& points, std::size_t i,
                          const Located& at) {
  const structures::DistanceField::Layout& layout = field.layout;
  const Mask has_samples = hasSamples(at);
  Sampled out = sampleInBand(field, at, has_samples);
  if (hn::AllTrue(kD, out.exact)) return out;
  const Double beyond =
      hn::Max(hn::Sub(hn::Abs(out.distance), splat(structures::DistanceField::kHalfDiagonal * layout.voxel)),
              hn::Zero(kD));
  out.distance = hn::IfThenElse(out.exact, out.distance, hn::CopySign(beyond, out.distance));
  if (hn::AllTrue(kD, has_samples)) return out;
  const Double magnitude = farMagnitude(field, at);
  const Mask deep = hn::Eq(at.entry_number, splat(structures::DistanceField::kFarInside));
  const Double far = hn::IfThenElse(deep, hn::Neg(magnitude), magnitude);
  out.distance =
      hn::IfThenElse(has_samples, out.distance,
                     hn::IfThenElse(at.in_grid, far, distanceToGrid(field, inB(field.frame, points, i))));
  return out;
}

/// Locations of a run of points, computed ahead of sampling: in a short loop the memory accesses to the index
/// overlap.
struct LocatedLanes {
  static constexpr std::size_t kCapacity = 8 * structures::ShellBlock::kLanes;

  alignas(64) std::array<double, kCapacity> x, y, z;
  alignas(64) std::array<std::int32_t, kCapacity> brick_index, entry;
  /// At the first lane of each vector: bit mask of its lanes in the grid.
  std::array<std::uint32_t, kCapacity> in_grid;

  HWY_INLINE void locateFrom(const FieldLanes& field, const PointLanes& points, std::size_t first) {
    const std::size_t count = std::min(kCapacity, points.count - first);
    for (std::size_t i = 0; i < count; i += hn::Lanes(kD)) {
      const Located at = locate(field, inB(field.frame, points, first + i));
      hn::Store(at.p_brick.x, kD, x.data() + i);
      hn::Store(at.p_brick.y, kD, y.data() + i);
      hn::Store(at.p_brick.z, kD, z.data() + i);
      hn::StoreU(at.brick_index, kI, brick_index.data() + i);
      hn::StoreU(at.entry, kI, entry.data() + i);
      in_grid[i] = bitsOf(at.in_grid);
    }
  }
  [[nodiscard]] HWY_INLINE Located at(std::size_t i) const {
    const Int own = hn::LoadU(kI, entry.data() + i);
    return {maskOf(in_grid[i]),
            hn::LoadU(kI, brick_index.data() + i),
            own,
            toDouble(own),
            {hn::Load(kD, x.data() + i), hn::Load(kD, y.data() + i), hn::Load(kD, z.data() + i)}};
  }
};

/// QueryKernels::samples
void samples(const LaneFrame& frame, const PointLanes& points, SampleLanes* out, SampleSums& sums) noexcept {
  const FieldLanes field(frame);
  const Double far_gap = splat(kFarGap);
  Double smallest = far_gap;
  Double smallest_far = far_gap;
  LocatedLanes located;
  for (std::size_t first = 0; first < points.count; first += structures::ShellBlock::kLanes) {
    const std::size_t here = first % LocatedLanes::kCapacity;
    if (here == 0) located.locateFrom(field, points, first);
    SampleLanes& block = *out++;
    const std::size_t end = std::min(first + structures::ShellBlock::kLanes, points.count);
    std::uint32_t all_exact = 0;
    std::uint32_t all_near = 0;
    std::uint32_t colliding = 0;
    for (std::size_t i = first; i < end; i += hn::Lanes(kD)) {
      const std::size_t lane = i - first;
      const Mask used = hn::FirstN(kD, end - i);
      const Sampled there = sample(field, points, i, located.at(here + lane));
      const Double gap = there.distance;
      const Mask exact = hn::And(used, there.exact);
      const Mask near = hn::And(exact, hn::Le(gap, splat(frame.margin)));
      hn::Store(there.distance, kD, block.distance.data() + lane);
      hn::Store(there.gradient.x, kD, block.gradient_x.data() + lane);
      hn::Store(there.gradient.y, kD, block.gradient_y.data() + lane);
      hn::Store(there.gradient.z, kD, block.gradient_z.data() + lane);
      all_exact |= bitsOf(exact) << lane;
      all_near |= bitsOf(near) << lane;
      colliding |= bitsOf(hn::And(used, hn::Lt(gap, hn::Zero(kD)))) << lane;
      smallest = hn::Min(hn::IfThenElse(used, there.distance, far_gap), smallest);
      smallest_far = hn::Min(hn::IfThenElse(hn::AndNot(near, used), gap, far_gap), smallest_far);
    }
    block.exact = all_exact;
    block.near = all_near;
    sums.colliding += static_cast<std::uint32_t>(hwy::PopCount(colliding));
    sums.near += static_cast<std::uint32_t>(hwy::PopCount(all_near));
  }
  sums.smallest_distance = std::min(sums.smallest_distance, hn::GetLane(hn::MinOfLanes(kD, smallest)));
  sums.smallest_far_gap = std::min(sums.smallest_far_gap, hn::GetLane(hn::MinOfLanes(kD, smallest_far)));
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#endif
