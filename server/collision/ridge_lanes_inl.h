// Kernels of the ridge correction. Included once for every instruction set, after sample_lanes_inl.h.

#if defined(TENON_RIDGE_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_RIDGE_LANES
#undef TENON_RIDGE_LANES
#else
#define TENON_RIDGE_LANES
#endif

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"
#include "server/collision/sample_lanes_inl.h"

HWY_BEFORE_NAMESPACE();
namespace tenon::collision {
namespace HWY_NAMESPACE {

namespace exact {

/// 1 - |gradient|^2: 0 for the gradient of a distance, more near a ridge.
HWY_INLINE Double unitDeficit(const Vec3& gradient) {
  const Double squared =
      sum3(hn::Mul(gradient.x, gradient.x), hn::Mul(gradient.y, gradient.y), hn::Mul(gradient.z, gradient.z));
  return hn::Sub(splat(1.0), squared);
}

/// QueryKernels::non_unit_gradients
std::uint32_t nonUnitGradients(std::span<const SampleLanes> samples, std::uint32_t* lanes) noexcept {
  constexpr double kMinDeficit = 0.1;  // [-] smaller deficits cost as much and change depths little
  std::uint32_t count = 0;
  for (const SampleLanes& block : samples) {
    std::uint32_t found = 0;
    for (std::size_t i = 0; i < structures::ShellBlock::kLanes && block.near != 0; i += hn::Lanes(kD)) {
      const Mask inside = hn::Lt(hn::Load(kD, block.distance.data() + i), hn::Zero(kD));
      found |= bitsOf(hn::And(inside, hn::Gt(unitDeficit(gradientOf(block, i)), splat(kMinDeficit)))) << i;
    }
    *lanes++ = found & block.near;
    count += static_cast<std::uint32_t>(hwy::PopCount(found & block.near));
  }
  return count;
}

/// QueryKernels::tangent_planes
void tangentPlanes(const LaneFrame& frame, const ProbeOffsets& offsets, const Vector3& p_BP, double scale,
                   TangentPlanes& out) noexcept {
  constexpr double kUnitTolerance = 0.02;  // [-] quantised samples alone cause a few thousandths
  const FieldLanes field(frame);
  for (std::size_t i = 0; i < ProbeOffsets::kProbes; i += hn::Lanes(kD)) {
    const Vec3 offset{hn::Mul(hn::Load(kD, offsets.x.data() + i), splat(scale)),
                      hn::Mul(hn::Load(kD, offsets.y.data() + i), splat(scale)),
                      hn::Mul(hn::Load(kD, offsets.z.data() + i), splat(scale))};
    const Vec3 p_BQ{hn::Add(splat(p_BP[0]), offset.x), hn::Add(splat(p_BP[1]), offset.y),
                    hn::Add(splat(p_BP[2]), offset.z)};
    const Located at = locate(field, p_BQ);
    const Sampled there = sampleInBand(field, at, hasSamples(at));
    const Vec3& gradient = there.gradient;
    const Double rise =
        sum3(hn::Mul(gradient.x, offset.x), hn::Mul(gradient.y, offset.y), hn::Mul(gradient.z, offset.z));
    // a probe without a sample has gradient 0: not unit
    const Mask unit = hn::Le(hn::Abs(unitDeficit(gradient)), splat(kUnitTolerance));
    hn::Store(hn::IfThenElse(unit, hn::Sub(there.distance, rise), splat(kNoPlane)), kD,
              out.distance.data() + i);
    hn::Store(gradient.x, kD, out.gradient_x.data() + i);
    hn::Store(gradient.y, kD, out.gradient_y.data() + i);
    hn::Store(gradient.z, kD, out.gradient_z.data() + i);
  }
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#endif
