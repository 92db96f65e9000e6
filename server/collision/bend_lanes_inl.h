// Where a field bends, and planes of where it does not. Included once for every instruction set, after the
// lanes of samples.

#if defined(TENON_BEND_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_BEND_LANES
#undef TENON_BEND_LANES
#else
#define TENON_BEND_LANES
#endif

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"
#include "server/collision/sample_lanes_inl.h"

HWY_BEFORE_NAMESPACE();
namespace tenon {
namespace HWY_NAMESPACE {

namespace exact {

/// A distance's slope is one. How much less its square is here.
HWY_INLINE Double bendOf(const Place3& gradient) {
  const Double squared =
      sum3(hn::Mul(gradient.x, gradient.x), hn::Mul(gradient.y, gradient.y), hn::Mul(gradient.z, gradient.z));
  return hn::Sub(all(1.0), squared);
}

std::uint32_t bent(const LaneFrame& frame, std::span<const SampleLanes> samples,
                   std::uint32_t* lanes) noexcept {
  constexpr double kBent = 0.1;  // less takes as long, and is worth little
  std::uint32_t count = 0;
  for (const SampleLanes& block : samples) {
    std::uint32_t found = 0;
    for (std::size_t i = 0; i < ShellBlock::kLanes && block.near != 0; i += hn::Lanes(kD)) {
      const Mask inside = hn::Lt(hn::Load(kD, block.distance.data() + i), all(frame.dilation));
      found |= bitsOf(hn::And(inside, hn::Gt(bendOf(gradientOf(block, i)), all(kBent)))) << i;
    }
    *lanes++ = found & block.near;
    count += static_cast<std::uint32_t>(hwy::PopCount(found & block.near));
  }
  return count;
}

void planes(const LaneFrame& frame, const ProbeSides& sides, const Vector3& p_BP, double scale,
            Planes& out) noexcept {
  constexpr double kStraight = 0.02;  // rounded samples alone make a few thousandths
  const FieldLanes field(frame);
  for (std::size_t i = 0; i < ProbeSides::kSides; i += hn::Lanes(kD)) {
    const Place3 way{hn::Mul(hn::Load(kD, sides.x.data() + i), all(scale)),
                     hn::Mul(hn::Load(kD, sides.y.data() + i), all(scale)),
                     hn::Mul(hn::Load(kD, sides.z.data() + i), all(scale))};
    const Place3 p_BQ{hn::Add(all(p_BP[0]), way.x), hn::Add(all(p_BP[1]), way.y),
                      hn::Add(all(p_BP[2]), way.z)};
    const Located at = locate(field, p_BQ);
    const Sampled there = sampleInBand(field, at, hasSamples(at));
    const Place3& gradient = there.gradient;
    const Double rise =
        sum3(hn::Mul(gradient.x, way.x), hn::Mul(gradient.y, way.y), hn::Mul(gradient.z, way.z));
    // a probe without a sample has no slope
    const Mask straight = hn::Le(hn::Abs(bendOf(gradient)), all(kStraight));
    hn::Store(hn::IfThenElse(straight, hn::Sub(there.distance, rise), all(kNoPlane)), kD,
              out.distance.data() + i);
    hn::Store(gradient.x, kD, out.gradient_x.data() + i);
    hn::Store(gradient.y, kD, out.gradient_y.data() + i);
    hn::Store(gradient.z, kD, out.gradient_z.data() + i);
  }
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
