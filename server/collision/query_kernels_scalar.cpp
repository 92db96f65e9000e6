#include <algorithm>

#include "server/collision/query_kernels.h"

namespace tenon {
namespace {

Vector3 lane(const ShellBlock& block, std::size_t i) {
  return Vector3f(block.x[i], block.y[i], block.z[i]).cast<double>();
}

BallLanes balls(const LaneFrame& frame, const ShellBlock& block, bool closer) noexcept {
  BallLanes out;
  out.smallest_bound = kNothingNear;
  for (std::uint32_t i = 0; i < block.count; ++i) {
    const Vector3 p_BC = frame.inB(lane(block, i));
    const double need = static_cast<double>(block.radius[i]) + frame.sphere_slack + frame.dilation;
    double bound = frame.field.lowerBound(p_BC) - need;
    if (bound <= frame.margin && closer) {
      // the interpolant at a point is above the true distance there less half a voxel's diagonal, that is
      // above the true distance here less the way; and so back to the interpolant here
      const FieldSample sample = frame.field.sample(p_BC);
      bound = sample.distance - (sample.exact ? 2.0 : 1.0) * kHalfDiagonal * frame.field.voxel() - need;
    }
    if (bound <= frame.margin) {
      out.reaching |= 1U << i;
    } else {
      out.smallest_bound = std::min(out.smallest_bound, bound);
    }
  }
  return out;
}

void samples(const LaneFrame& frame, const ShellBlock& block, SampleLanes& out) noexcept {
  out.exact = out.near = out.colliding = 0;
  out.smallest_distance = out.smallest_gap_apart = kNothingNear;
  for (std::uint32_t i = 0; i < block.count; ++i) {
    const FieldSample sample = frame.field.sample(frame.inB(lane(block, i)));
    const double gap = sample.distance - frame.dilation;
    out.distance[i] = sample.distance;
    out.gradient_x[i] = sample.gradient.x();
    out.gradient_y[i] = sample.gradient.y();
    out.gradient_z[i] = sample.gradient.z();
    out.smallest_distance = std::min(out.smallest_distance, sample.distance);
    if (gap < 0.0) ++out.colliding;
    if (sample.exact) out.exact |= 1U << i;
    if (sample.exact && gap <= frame.margin) {
      out.near |= 1U << i;
    } else {
      out.smallest_gap_apart = std::min(out.smallest_gap_apart, gap);
    }
  }
}

void contacts(const LaneFrame& frame, const ShellBlock& block, const SampleLanes& samples,
              ContactLanes& out) noexcept {
  out.sloping = 0;
  for (std::uint32_t i = 0; i < block.count; ++i) {
    const Vector3 p_WP = frame.p_WA + turned(frame.R_WA, lane(block, i));
    out.x[i] = p_WP.x();
    out.y[i] = p_WP.y();
    out.z[i] = p_WP.z();
    const Vector3 gradient(samples.gradient_x[i], samples.gradient_y[i], samples.gradient_z[i]);
    const double slope = gradient.norm();
    if (!(slope >= kLeastGradient)) continue;
    out.sloping |= 1U << i;
    const Vector3 n_W = turned(frame.R_WB, gradient / slope);
    out.n_x[i] = n_W.x();
    out.n_y[i] = n_W.y();
    out.n_z[i] = n_W.z();
  }
}

}  // namespace

QueryKernels scalarKernels() noexcept { return {"scalar", balls, samples, contacts}; }

}  // namespace tenon
