// Where contacts are, how they are turned and what they push. Included once for every instruction set, after
// the lanes of samples.

#if defined(TENON_CONTACT_LANES) == defined(HWY_TARGET_TOGGLE)
#ifdef TENON_CONTACT_LANES
#undef TENON_CONTACT_LANES
#else
#define TENON_CONTACT_LANES
#endif

#include <algorithm>
#include <span>

#include <hwy/highway.h>

#include "server/collision/query_kernels.h"
#include "server/collision/sample_lanes_inl.h"

HWY_BEFORE_NAMESPACE();
namespace tenon {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

namespace exact {

void contacts(const LaneFrame& frame, const PointLanes& points, const SampleLanes* samples,
              ContactLanes* out) noexcept {
  for (std::size_t first = 0; first < points.count; first += ShellBlock::kLanes) {
    const SampleLanes& lanes = *samples++;
    ContactLanes& block = *out++;
    block.sloping = 0;
    if (lanes.exact == 0) continue;
    const std::size_t end = std::min(first + ShellBlock::kLanes, points.count);
    for (std::size_t i = first; i < end; i += hn::Lanes(kD)) {
      const std::size_t lane = i - first;
      const Place3 p_W = moved(frame.p_WA.data(), frame.R_WA.data(), placesOf(points, i));
      const Place3 gradient = gradientOf(lanes, lane);
      const Double slope = norm(gradient);
      const Double per_slope = hn::Div(all(1.0), slope);
      const Place3 n_W = turned(
          frame.R_WB.data(),
          {hn::Mul(gradient.x, per_slope), hn::Mul(gradient.y, per_slope), hn::Mul(gradient.z, per_slope)});
      block.sloping |= bitsOf(hn::Ge(slope, all(kLeastGradient))) << lane;
      hn::Store(p_W.x, kD, block.x.data() + lane);
      hn::Store(p_W.y, kD, block.y.data() + lane);
      hn::Store(p_W.z, kD, block.z.data() + lane);
      hn::Store(n_W.x, kD, block.n_x.data() + lane);
      hn::Store(n_W.y, kD, block.n_y.data() + lane);
      hn::Store(n_W.z, kD, block.n_z.data() + lane);
    }
  }
}

/// What the points stand for; those beyond the end for nothing.
HWY_INLINE Double areasOf(const std::uint32_t* points, std::span<const float> areas) {
  const Whole point = hn::LoadU(kI, reinterpret_cast<const std::int32_t*>(points));
  const Whole last = allWhole(static_cast<std::int32_t>(areas.size()) - 1);
  const auto area = hn::GatherIndex(kF, areas.data(), hn::Min(point, last));
  return hn::PromoteTo(kD, hn::IfThenZeroElse(hn::RebindMask(kF, hn::Gt(point, last)), area));
}

void pushes(const LaneFrame& frame, const SampleLanes& lanes, const ContactLanes& contacts,
            const std::uint32_t* points, std::span<const float> areas, PushLanes& out) noexcept {
  std::uint32_t all_pushing = 0;
  for (std::size_t i = 0; i < ShellBlock::kLanes; i += hn::Lanes(kD)) {
    const Double gap = hn::Sub(hn::Load(kD, lanes.distance.data() + i), all(frame.dilation));
    const Mask pushing = hn::And(maskOf(lanes.near >> i), hn::Lt(gap, hn::Zero(kD)));
    const Double penalty =
        hn::Mul(hn::Mul(hn::Neg(gap), areasOf(points + i, areas)), all(1.0 / kReferenceArea));
    const Place3 f{hn::Mul(penalty, hn::Load(kD, contacts.n_x.data() + i)),
                   hn::Mul(penalty, hn::Load(kD, contacts.n_y.data() + i)),
                   hn::Mul(penalty, hn::Load(kD, contacts.n_z.data() + i))};
    const Place3 r{hn::Sub(hn::Load(kD, contacts.x.data() + i), all(frame.p_WA[0])),
                   hn::Sub(hn::Load(kD, contacts.y.data() + i), all(frame.p_WA[1])),
                   hn::Sub(hn::Load(kD, contacts.z.data() + i), all(frame.p_WA[2]))};
    const Place3 t{hn::Sub(hn::Mul(r.y, f.z), hn::Mul(r.z, f.y)),
                   hn::Sub(hn::Mul(r.z, f.x), hn::Mul(r.x, f.z)),
                   hn::Sub(hn::Mul(r.x, f.y), hn::Mul(r.y, f.x))};
    hn::Store(hn::IfThenElseZero(pushing, f.x), kD, out.f_x.data() + i);
    hn::Store(hn::IfThenElseZero(pushing, f.y), kD, out.f_y.data() + i);
    hn::Store(hn::IfThenElseZero(pushing, f.z), kD, out.f_z.data() + i);
    hn::Store(hn::IfThenElseZero(pushing, t.x), kD, out.t_x.data() + i);
    hn::Store(hn::IfThenElseZero(pushing, t.y), kD, out.t_y.data() + i);
    hn::Store(hn::IfThenElseZero(pushing, t.z), kD, out.t_z.data() + i);
    all_pushing |= bitsOf(pushing) << i;
  }
  out.pushing = all_pushing;
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#endif
