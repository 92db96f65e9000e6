// Kernels of contact positions, normals and penalties. Included once for every instruction set, after
// sample_lanes_inl.h.

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
namespace tenon::collision {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

namespace exact {

/// Position and normal of the points at `lane` of `block`; returns the lanes that have a normal.
HWY_INLINE std::uint32_t storeContacts(const LaneFrame& frame, const Vec3& p_A, const Vec3& gradient,
                                       std::size_t lane, ContactLanes& block) {
  const Vec3 p_W = transformed(frame.p_WA.data(), frame.R_WA.data(), p_A);
  const Double length = norm(gradient);
  const Double per_length = hn::Div(splat(1.0), length);
  const Vec3 n_W = rotated(
      frame.R_WB.data(),
      {hn::Mul(gradient.x, per_length), hn::Mul(gradient.y, per_length), hn::Mul(gradient.z, per_length)});
  hn::Store(p_W.x, kD, block.x.data() + lane);
  hn::Store(p_W.y, kD, block.y.data() + lane);
  hn::Store(p_W.z, kD, block.z.data() + lane);
  hn::Store(n_W.x, kD, block.n_x.data() + lane);
  hn::Store(n_W.y, kD, block.n_y.data() + lane);
  hn::Store(n_W.z, kD, block.n_z.data() + lane);
  return bitsOf(hn::Ge(length, splat(kMinGradient))) << lane;
}

/// QueryKernels::contacts
void contacts(const LaneFrame& frame, const PointLanes& points, const SampleLanes* samples,
              ContactLanes* out) noexcept {
  for (std::size_t first = 0; first < points.count; first += structures::ShellBlock::kLanes) {
    const SampleLanes& lanes = *samples++;
    ContactLanes& block = *out++;
    block.has_normal = 0;
    if (lanes.exact == 0) continue;
    const std::size_t end = std::min(first + structures::ShellBlock::kLanes, points.count);
    for (std::size_t i = first; i < end; i += hn::Lanes(kD)) {
      const std::size_t lane = i - first;
      block.has_normal |= storeContacts(frame, loadPoints(points, i), gradientOf(lanes, lane), lane, block);
    }
  }
}

/// QueryKernels::near_contacts
void nearContacts(const LaneFrame& frame, const NearPoints& near, std::size_t first,
                  ContactLanes& out) noexcept {
  out.has_normal = 0;
  const PointLanes points{near.x.data(), near.y.data(), near.z.data(), near.count};
  const std::size_t end = std::min(first + structures::ShellBlock::kLanes, near.count);
  for (std::size_t i = first; i < end; i += hn::Lanes(kD)) {
    const Vec3 gradient{hn::LoadU(kD, near.gradient_x.data() + i), hn::LoadU(kD, near.gradient_y.data() + i),
                        hn::LoadU(kD, near.gradient_z.data() + i)};
    out.has_normal |= storeContacts(frame, loadPoints(points, i), gradient, i - first, out);
  }
}

/// Areas of points [m^2]; 0 beyond the end.
HWY_INLINE Double areasOf(const std::uint32_t* points, std::span<const float> areas) {
  const Int point = hn::LoadU(kI, reinterpret_cast<const std::int32_t*>(points));
  const Int last = splatInt(static_cast<std::int32_t>(areas.size()) - 1);
  const auto area = hn::GatherIndex(kF, areas.data(), hn::Min(point, last));
  return hn::PromoteTo(kD, hn::IfThenZeroElse(hn::RebindMask(kF, hn::Gt(point, last)), area));
}

/// QueryKernels::penalties
void penalties(const LaneFrame& frame, const SampleLanes& lanes, const ContactLanes& contacts,
               const std::uint32_t* points, std::span<const float> areas, PenaltyLanes& out) noexcept {
  std::uint32_t all_inside = 0;
  for (std::size_t i = 0; i < structures::ShellBlock::kLanes; i += hn::Lanes(kD)) {
    const Double gap = hn::Load(kD, lanes.distance.data() + i);
    const Mask inside = hn::And(maskOf(lanes.near >> i), hn::Lt(gap, hn::Zero(kD)));
    const Double penalty =
        hn::Mul(hn::Mul(hn::Neg(gap), areasOf(points + i, areas)), splat(1.0 / kReferenceArea));
    const Vec3 f{hn::Mul(penalty, hn::Load(kD, contacts.n_x.data() + i)),
                 hn::Mul(penalty, hn::Load(kD, contacts.n_y.data() + i)),
                 hn::Mul(penalty, hn::Load(kD, contacts.n_z.data() + i))};
    const Vec3 r{hn::Sub(hn::Load(kD, contacts.x.data() + i), splat(frame.p_WA[0])),
                 hn::Sub(hn::Load(kD, contacts.y.data() + i), splat(frame.p_WA[1])),
                 hn::Sub(hn::Load(kD, contacts.z.data() + i), splat(frame.p_WA[2]))};
    const Vec3 t{hn::Sub(hn::Mul(r.y, f.z), hn::Mul(r.z, f.y)), hn::Sub(hn::Mul(r.z, f.x), hn::Mul(r.x, f.z)),
                 hn::Sub(hn::Mul(r.x, f.y), hn::Mul(r.y, f.x))};
    hn::Store(hn::IfThenElseZero(inside, f.x), kD, out.f_x.data() + i);
    hn::Store(hn::IfThenElseZero(inside, f.y), kD, out.f_y.data() + i);
    hn::Store(hn::IfThenElseZero(inside, f.z), kD, out.f_z.data() + i);
    hn::Store(hn::IfThenElseZero(inside, t.x), kD, out.t_x.data() + i);
    hn::Store(hn::IfThenElseZero(inside, t.y), kD, out.t_y.data() + i);
    hn::Store(hn::IfThenElseZero(inside, t.z), kD, out.t_z.data() + i);
    all_inside |= bitsOf(inside) << i;
  }
  out.inside = all_inside;
}

}  // namespace exact
}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#endif
