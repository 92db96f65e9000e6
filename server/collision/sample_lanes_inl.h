// Distances in doubles, as DistanceField::sample has them, bit for bit. Included once for every instruction
// set.

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
namespace tenon {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

namespace exact {

// lanes are doubles; whole numbers have as many lanes of half the width
constexpr HWY_CAPPED(double, 16) kD;
constexpr hn::Rebind<std::int32_t, decltype(kD)> kI;
constexpr hn::Rebind<float, decltype(kD)> kF;
using Double = hn::Vec<decltype(kD)>;
using Whole = hn::Vec<decltype(kI)>;
using Mask = hn::Mask<decltype(kD)>;

constexpr int kVoxels = DistanceField::kBrickVoxels;
constexpr int kSide = DistanceField::kBrickSide;
constexpr int kLayer = kSide * kSide;

struct Place3 {
  Double x, y, z;
};

HWY_INLINE Double all(double value) { return hn::Set(kD, value); }
HWY_INLINE Whole allWhole(std::int32_t value) { return hn::Set(kI, value); }
HWY_INLINE Double toDouble(Whole v) { return hn::PromoteTo(kD, v); }
#if HWY_TARGET == HWY_SCALAR
// all values are in range: what is outside the grid stands at its corner
HWY_INLINE Whole truncated(Double v) { return Whole(static_cast<std::int32_t>(v.raw)); }
#else
HWY_INLINE Whole truncated(Double v) { return hn::DemoteTo(kI, v); }
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
HWY_INLINE Double norm(const Place3& v) {
  return hn::Sqrt(sum3(hn::Mul(v.x, v.x), hn::Mul(v.y, v.y), hn::Mul(v.z, v.z)));
}
HWY_INLINE Place3 turned(const double* R, const Place3& v) {  // R column by column
  return {sum3(hn::Mul(all(R[0]), v.x), hn::Mul(all(R[3]), v.y), hn::Mul(all(R[6]), v.z)),
          sum3(hn::Mul(all(R[1]), v.x), hn::Mul(all(R[4]), v.y), hn::Mul(all(R[7]), v.z)),
          sum3(hn::Mul(all(R[2]), v.x), hn::Mul(all(R[5]), v.y), hn::Mul(all(R[8]), v.z))};
}
HWY_INLINE Place3 moved(const double* p, const double* R, const Place3& v) {
  const Place3 turn = turned(R, v);
  return {hn::Add(all(p[0]), turn.x), hn::Add(all(p[1]), turn.y), hn::Add(all(p[2]), turn.z)};
}
HWY_INLINE Place3 placesOf(const PointLanes& points, std::size_t first) {
  return {hn::PromoteTo(kD, hn::LoadU(kF, points.x + first)),
          hn::PromoteTo(kD, hn::LoadU(kF, points.y + first)),
          hn::PromoteTo(kD, hn::LoadU(kF, points.z + first))};
}

HWY_INLINE Place3 inB(const LaneFrame& frame, const PointLanes& points, std::size_t first) {
  return moved(frame.p_BA_B.data(), frame.R_BA.data(), placesOf(points, first));
}

HWY_INLINE Place3 gradientOf(const SampleLanes& samples, std::size_t lane) {
  return {hn::Load(kD, samples.gradient_x.data() + lane), hn::Load(kD, samples.gradient_y.data() + lane),
          hn::Load(kD, samples.gradient_z.data() + lane)};
}

/// A field with its constants spread over the lanes where that pays.
struct FieldLanes {
  explicit FieldLanes(const LaneFrame& the_frame)
      : frame(the_frame),
        layout(the_frame.field.layout()),
        edge(layout.voxel * kVoxels),
        inverse_edge(1.0 / edge),
        samples(reinterpret_cast<const std::int32_t*>(layout.samples.data())),
        far(reinterpret_cast<const std::int32_t*>(layout.far.data())) {}

  const LaneFrame& frame;
  const DistanceField::Layout& layout;
  double edge, inverse_edge;
  const std::int32_t* samples;  ///< read at byte offsets, two samples at a time
  const std::int32_t* far;
};

/// DistanceField::locate; lanes outside the grid stand at its lowest corner.
struct Located {
  Mask inside;
  Whole number, entry;
  Double entry_number;
  Place3 p_brick;
};

HWY_INLINE Double inGrid(Double p, double origin, double inverse_edge) {
  return hn::Mul(hn::Sub(p, all(origin)), all(inverse_edge));
}

HWY_INLINE Located locate(const FieldLanes& field, const Place3& p_B) {
  const Vector3& origin = field.layout.p_MoFo_M;
  const auto& bricks = field.layout.bricks;
  const Double zero = hn::Zero(kD);
  Double x = inGrid(p_B.x, origin[0], field.inverse_edge);
  Double y = inGrid(p_B.y, origin[1], field.inverse_edge);
  Double z = inGrid(p_B.z, origin[2], field.inverse_edge);
  Located at;
  at.inside = hn::And(hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, all(bricks[0]))),
                              hn::And(hn::Ge(y, zero), hn::Lt(y, all(bricks[1])))),
                      hn::And(hn::Ge(z, zero), hn::Lt(z, all(bricks[2]))));
  x = hn::IfThenElseZero(at.inside, x);
  y = hn::IfThenElseZero(at.inside, y);
  z = hn::IfThenElseZero(at.inside, z);
  const Whole bx = truncated(x);
  const Whole by = truncated(y);
  const Whole bz = truncated(z);
  at.p_brick = {hn::Sub(x, toDouble(bx)), hn::Sub(y, toDouble(by)), hn::Sub(z, toDouble(bz))};
  at.number = hn::Add(hn::Mul(hn::Add(hn::Mul(bz, allWhole(bricks[1])), by), allWhole(bricks[0])), bx);
  at.entry = hn::GatherIndex(kI, field.layout.index.data(), at.number);
  at.entry_number = toDouble(at.entry);
  return at;
}

HWY_INLINE Double farOf(const FieldLanes& field, Whole number) {
  // two at a time: the last is the upper half of the pair before it
  const Whole last = allWhole(static_cast<std::int32_t>(2 * field.layout.far.size() - 4));
  const Whole wanted = hn::ShiftLeft<1>(number);
  const Whole pair = hn::GatherOffset(kI, field.far, hn::Min(wanted, last));
  const Whole upper = hn::IfThenElse(hn::Gt(wanted, last), pair, hn::ShiftLeft<16>(pair));
  return toDouble(hn::ShiftRight<16>(upper));
}

HWY_INLINE Double fromBrickCentre(const FieldLanes& field, const Place3& p_brick) {
  const Double half = all(0.5);
  const Double edge = all(field.edge);
  return norm({hn::Mul(hn::Sub(p_brick.x, half), edge), hn::Mul(hn::Sub(p_brick.y, half), edge),
               hn::Mul(hn::Sub(p_brick.z, half), edge)});
}

HWY_INLINE Double farMagnitude(const FieldLanes& field, const Located& at) {
  const double voxel = field.layout.voxel;
  const double beyond_band = field.layout.band - DistanceField::kHalfDiagonal * voxel;
  const Double at_centre =
      hn::Div(hn::Mul(hn::Abs(farOf(field, at.number)), all(voxel)), all(DistanceField::kFarPerVoxel));
  return hn::Max(all(beyond_band), hn::Sub(at_centre, fromBrickCentre(field, at.p_brick)));
}

HWY_INLINE Double outsideOf(double low, double high, Double p) {
  return hn::Max(hn::Max(hn::Sub(all(low), p), hn::Sub(p, all(high))), hn::Zero(kD));
}

HWY_INLINE Double distanceToGrid(const FieldLanes& field, const Place3& p) {
  const Eigen::AlignedBox3d& box = field.frame.box_B;
  const double* low = box.min().data();
  const double* high = box.max().data();
  const Place3 outside{outsideOf(low[0], high[0], p.x), outsideOf(low[1], high[1], p.y),
                       outsideOf(low[2], high[2], p.z)};
  return hn::Add(norm(outside), all(field.layout.margin));
}

struct Sampled {
  Double distance;
  Place3 gradient;
  Mask exact;
};

/// DistanceField::interpolate
HWY_INLINE Sampled interpolate(const FieldLanes& field, Whole brick, const Place3& p_brick, Double voxel,
                               Double band) {
  const Double voxels = all(kVoxels);
  const Double px = hn::Mul(p_brick.x, voxels);
  const Double py = hn::Mul(p_brick.y, voxels);
  const Double pz = hn::Mul(p_brick.z, voxels);
  const Whole most = allWhole(kVoxels - 1);
  const Whole x = hn::Min(truncated(px), most);
  const Whole y = hn::Min(truncated(py), most);
  const Whole z = hn::Min(truncated(pz), most);
  const Double u = hn::Sub(px, toDouble(x));
  const Double v = hn::Sub(py, toDouble(y));
  const Double w = hn::Sub(pz, toDouble(z));
  const Whole row = hn::Add(hn::Mul(hn::Add(hn::Mul(z, allWhole(kSide)), y), allWhole(kSide)), x);
  const Whole place = hn::ShiftLeft<1>(hn::Add(hn::Mul(brick, allWhole(DistanceField::kBrickSamples)), row));

  // neighbours along x come together
  const Whole g00 = hn::GatherOffset(kI, field.samples, place);
  const Whole g10 = hn::GatherOffset(kI, field.samples, hn::Add(place, allWhole(2 * kSide)));
  const Whole g01 = hn::GatherOffset(kI, field.samples, hn::Add(place, allWhole(2 * kLayer)));
  const Whole g11 = hn::GatherOffset(kI, field.samples, hn::Add(place, allWhole(2 * (kLayer + kSide))));
  const Whole s00 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g00));
  const Whole s10 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g10));
  const Whole s01 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g01));
  const Whole s11 = hn::ShiftRight<16>(hn::ShiftLeft<16>(g11));
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

  const Double per_quantum = all(1.0 / DistanceField::kQuantaPerVoxel);
  const Double rise = hn::Sub(c1, c0);
  Sampled out;
  out.distance = hn::Mul(hn::Mul(hn::Add(c0, hn::Mul(rise, w)), per_quantum), voxel);
  out.gradient = {hn::Mul(hn::Add(d0, hn::Mul(hn::Sub(d1, d0), w)), per_quantum),
                  hn::Mul(hn::Add(e0, hn::Mul(hn::Sub(e1, e0), w)), per_quantum), hn::Mul(rise, per_quantum)};
  out.exact = hn::Le(hn::Abs(out.distance), band);
  return out;
}

/// The child of a refined lane where it has samples, else the lane's own coarse brick.
HWY_INLINE Sampled interpolateRefined(const FieldLanes& field, const Located& at, Mask refined) {
  const DistanceField::Layout& layout = field.layout;
  const int r = layout.refinement;
  const Double coarse_voxel = all(layout.voxel);
  const Double coarse_band = all(layout.band);
  const Double fine_voxel = all(layout.voxel / r);
  const Double fine_band = all(DistanceField::kBandVoxels * (layout.voxel / r));
  const Double rd = all(r);
  const Double zero = hn::Zero(kD);
  const Place3 p{hn::Mul(at.p_brick.x, rd), hn::Mul(at.p_brick.y, rd), hn::Mul(at.p_brick.z, rd)};
  const Whole most = allWhole(r - 1);
  const Whole cx = hn::Min(truncated(p.x), most);
  const Whole cy = hn::Min(truncated(p.y), most);
  const Whole cz = hn::Min(truncated(p.z), most);
  // lanes without children read any entry
  const Double first = hn::IfThenElseZero(refined, hn::Sub(at.entry_number, all(DistanceField::kRefined)));
  const Whole children = truncated(first);
  const Whole child = hn::Add(hn::Mul(hn::Add(hn::Mul(cz, allWhole(r)), cy), allWhole(r)), cx);
  const Whole child_place = truncated(hn::IfThenElseZero(refined, toDouble(hn::Add(children, child))));
  const Whole own_place =
      truncated(hn::IfThenElseZero(refined, toDouble(hn::Add(children, allWhole(r * r * r)))));
  const Double fine = toDouble(hn::GatherIndex(kI, layout.index.data(), child_place));
  const Double own = toDouble(hn::GatherIndex(kI, layout.index.data(), own_place));
  const Mask has_fine = hn::And(refined, hn::Ge(fine, zero));
  const Mask plain =
      hn::And(hn::Ge(at.entry_number, zero), hn::Lt(at.entry_number, all(DistanceField::kRefined)));
  const Double coarse = hn::IfThenElse(refined, own, hn::IfThenElseZero(plain, at.entry_number));
  const Place3 p_child{hn::IfThenElse(has_fine, hn::Sub(p.x, toDouble(cx)), at.p_brick.x),
                       hn::IfThenElse(has_fine, hn::Sub(p.y, toDouble(cy)), at.p_brick.y),
                       hn::IfThenElse(has_fine, hn::Sub(p.z, toDouble(cz)), at.p_brick.z)};
  Sampled out = interpolate(field, truncated(hn::IfThenElse(has_fine, fine, coarse)), p_child,
                            hn::IfThenElse(has_fine, fine_voxel, coarse_voxel),
                            hn::IfThenElse(has_fine, fine_band, coarse_band));
  // out of its own narrow band a child knows less than the coarse brick
  const Mask again = hn::AndNot(out.exact, has_fine);
  if (hn::AllFalse(kD, again)) return out;
  const Sampled wide = interpolate(field, truncated(coarse), at.p_brick, coarse_voxel, coarse_band);
  out.distance = hn::IfThenElse(again, wide.distance, out.distance);
  out.gradient = {hn::IfThenElse(again, wide.gradient.x, out.gradient.x),
                  hn::IfThenElse(again, wide.gradient.y, out.gradient.y),
                  hn::IfThenElse(again, wide.gradient.z, out.gradient.z)};
  out.exact = hn::Or(out.exact, hn::And(again, wide.exact));
  return out;
}

/// DistanceField::sample where that is exact; elsewhere there is no gradient, and the distance may be
/// anything.
HWY_INLINE Sampled sampleInBand(const FieldLanes& field, const Located& at, Mask has_samples) {
  const DistanceField::Layout& layout = field.layout;
  const Mask refined = hn::And(at.inside, hn::Ge(at.entry_number, all(DistanceField::kRefined)));
  Sampled out{hn::Zero(kD), {hn::Zero(kD), hn::Zero(kD), hn::Zero(kD)}, has_samples};
  if (!hn::AllFalse(kD, refined)) {
    out = interpolateRefined(field, at, refined);
  } else if (!hn::AllFalse(kD, has_samples)) {
    out =
        interpolate(field, hn::Max(at.entry, hn::Zero(kI)), at.p_brick, all(layout.voxel), all(layout.band));
  }
  out.exact = hn::And(out.exact, has_samples);
  out.gradient = {hn::IfThenElseZero(out.exact, out.gradient.x),
                  hn::IfThenElseZero(out.exact, out.gradient.y),
                  hn::IfThenElseZero(out.exact, out.gradient.z)};
  return out;
}

HWY_INLINE Mask hasSamples(const Located& at) {
  return hn::And(at.inside, hn::Ge(at.entry_number, hn::Zero(kD)));
}

/// DistanceField::sample
HWY_INLINE Sampled sample(const FieldLanes& field, const PointLanes& points, std::size_t i,
                          const Located& at) {
  const DistanceField::Layout& layout = field.layout;
  const Mask has_samples = hasSamples(at);
  Sampled out = sampleInBand(field, at, has_samples);
  if (hn::AllTrue(kD, out.exact)) return out;
  const Double beyond =
      hn::Max(hn::Sub(hn::Abs(out.distance), all(DistanceField::kHalfDiagonal * layout.voxel)), hn::Zero(kD));
  out.distance = hn::IfThenElse(out.exact, out.distance, hn::CopySign(beyond, out.distance));
  if (hn::AllTrue(kD, has_samples)) return out;
  const Double magnitude = farMagnitude(field, at);
  const Mask deep = hn::Eq(at.entry_number, all(DistanceField::kFarInside));
  const Double far = hn::IfThenElse(deep, hn::Neg(magnitude), magnitude);
  out.distance =
      hn::IfThenElse(has_samples, out.distance,
                     hn::IfThenElse(at.inside, far, distanceToGrid(field, inB(field.frame, points, i))));
  return out;
}

/// Points that are located ahead, side by side: reading the index is waiting for memory, and for many points
/// at once in a short loop.
struct LocatedLanes {
  static constexpr std::size_t kMost = 8 * ShellBlock::kLanes;

  alignas(64) std::array<double, kMost> x, y, z;
  alignas(64) std::array<std::int32_t, kMost> number, entry;
  std::array<std::uint32_t, kMost> inside;  ///< a bit each of the lanes from here

  HWY_INLINE void locateFrom(const FieldLanes& field, const PointLanes& points, std::size_t first) {
    const std::size_t count = std::min(kMost, points.count - first);
    for (std::size_t i = 0; i < count; i += hn::Lanes(kD)) {
      const Located at = locate(field, inB(field.frame, points, first + i));
      hn::Store(at.p_brick.x, kD, x.data() + i);
      hn::Store(at.p_brick.y, kD, y.data() + i);
      hn::Store(at.p_brick.z, kD, z.data() + i);
      hn::StoreU(at.number, kI, number.data() + i);
      hn::StoreU(at.entry, kI, entry.data() + i);
      inside[i] = bitsOf(at.inside);
    }
  }
  [[nodiscard]] HWY_INLINE Located at(std::size_t i) const {
    const Whole own = hn::LoadU(kI, entry.data() + i);
    return {maskOf(inside[i]),
            hn::LoadU(kI, number.data() + i),
            own,
            toDouble(own),
            {hn::Load(kD, x.data() + i), hn::Load(kD, y.data() + i), hn::Load(kD, z.data() + i)}};
  }
};

void samples(const LaneFrame& frame, const PointLanes& points, SampleLanes* out, SampleSums& sums) noexcept {
  const FieldLanes field(frame);
  const Double nothing = all(kNothingNear);
  Double smallest = nothing;
  Double apart = nothing;
  LocatedLanes located;
  for (std::size_t first = 0; first < points.count; first += ShellBlock::kLanes) {
    const std::size_t here = first % LocatedLanes::kMost;
    if (here == 0) located.locateFrom(field, points, first);
    SampleLanes& block = *out++;
    const std::size_t end = std::min(first + ShellBlock::kLanes, points.count);
    std::uint32_t all_exact = 0;
    std::uint32_t all_near = 0;
    std::uint32_t colliding = 0;
    for (std::size_t i = first; i < end; i += hn::Lanes(kD)) {
      const std::size_t lane = i - first;
      const Mask used = hn::FirstN(kD, end - i);
      const Sampled there = sample(field, points, i, located.at(here + lane));
      const Double gap = hn::Sub(there.distance, all(frame.dilation));
      const Mask exact = hn::And(used, there.exact);
      const Mask near = hn::And(exact, hn::Le(gap, all(frame.margin)));
      hn::Store(there.distance, kD, block.distance.data() + lane);
      hn::Store(there.gradient.x, kD, block.gradient_x.data() + lane);
      hn::Store(there.gradient.y, kD, block.gradient_y.data() + lane);
      hn::Store(there.gradient.z, kD, block.gradient_z.data() + lane);
      all_exact |= bitsOf(exact) << lane;
      all_near |= bitsOf(near) << lane;
      colliding |= bitsOf(hn::And(used, hn::Lt(gap, hn::Zero(kD)))) << lane;
      smallest = hn::Min(hn::IfThenElse(used, there.distance, nothing), smallest);
      apart = hn::Min(hn::IfThenElse(hn::AndNot(near, used), gap, nothing), apart);
    }
    block.exact = all_exact;
    block.near = all_near;
    sums.colliding += static_cast<std::uint32_t>(hwy::PopCount(colliding));
    sums.near += static_cast<std::uint32_t>(hwy::PopCount(all_near));
  }
  sums.smallest_distance = std::min(sums.smallest_distance, hn::GetLane(hn::MinOfLanes(kD, smallest)));
  sums.smallest_gap_apart = std::min(sums.smallest_gap_apart, hn::GetLane(hn::MinOfLanes(kD, apart)));
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
