#include "server/collision/ridge_correction.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "server/collision/tangent_probes.h"

namespace tenon::collision {

namespace {

/// [voxels] Bound of the interpolation error per unit of the deficit 1 - |gradient|^2. The error is at most
/// 0.87; a little less than in proportion was best on CAD parts.
constexpr double kErrorPerDeficit = 0.65;

/// [voxels] A plane may exceed the interpolation by this: next to a concave edge interpolation is too deep.
constexpr double kMaxAbove = 0.1;

/// Whether another probe has a plane of about the same normal.
bool seenBySecondProbe(const TangentPlanes& planes, std::size_t plane) {
  for (std::size_t k = 0; k < ProbeOffsets::kProbes; ++k) {
    if (k == plane || planes.distance[k] == kNoPlane) continue;
    if (gradientOf(planes, k).dot(gradientOf(planes, plane)) > kSameNormal) return true;
  }
  return false;
}

/// Whether 1.5 voxels outside the plane the field has the plane's distance and gradient, as in front of a
/// face.
bool continuesOutside(const structures::DistanceField& field, const Vector3& p_BP, double distance,
                      const Vector3& gradient, double voxel) {
  const double beyond = 1.5 * voxel;
  const structures::FieldSample there = field.sample(p_BP + (beyond - distance) * gradient);
  return there.exact && there.gradient.dot(gradient) > kSameNormal &&
         std::abs(there.distance - beyond) < 0.1 * voxel;
}

/// Index of the highest plane that is not above the interpolation, nor below it by more than the error bound;
/// kProbes if there is none.
std::size_t highestPlane(const TangentPlanes& planes, double interpolated, double voxel, double deficit) {
  double best = interpolated - kErrorPerDeficit * deficit * voxel;
  std::size_t highest = ProbeOffsets::kProbes;
  for (std::size_t k = 0; k < ProbeOffsets::kProbes; ++k) {
    if (planes.distance[k] <= best || planes.distance[k] > interpolated + kMaxAbove * voxel) continue;
    best = planes.distance[k];
    highest = k;
  }
  return highest;
}

}  // namespace

void correctRidges(const LaneFrame& frame, const QueryKernels& kernels, const PointLanes& points,
                   std::span<SampleLanes> samples, SampleSums& sums) noexcept {
  std::array<std::uint32_t, Candidates::kCapacity / structures::ShellBlock::kLanes> non_unit;
  if (kernels.non_unit_gradients(samples, non_unit.data()) == 0) return;
  const structures::DistanceField& field = frame.field;
  const ProbeOffsets offsets = probeOffsets(kProbeDistance * field.voxel());
  for (std::size_t b = 0; b < samples.size(); ++b) {
    SampleLanes& block = samples[b];
    for (; non_unit[b] != 0; non_unit[b] &= non_unit[b] - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(non_unit[b]));
      const std::size_t i = b * structures::ShellBlock::kLanes + lane;
      const Vector3 p_BP = frame.inB(Vector3(points.x[i], points.y[i], points.z[i]));
      const double voxel = field.layout().refinement > 1 ? field.voxelAt(p_BP) : field.voxel();
      TangentPlanes planes;
      kernels.tangent_planes(frame, offsets, p_BP, voxel / field.voxel(), planes);
      const Vector3 interpolated(block.gradient_x[lane], block.gradient_y[lane], block.gradient_z[lane]);
      const std::size_t highest =
          highestPlane(planes, block.distance[lane], voxel, 1.0 - interpolated.squaredNorm());
      if (highest == ProbeOffsets::kProbes) continue;
      const Vector3 gradient = gradientOf(planes, highest);
      const double distance = planes.distance[highest];
      if (!seenBySecondProbe(planes, highest) && !continuesOutside(field, p_BP, distance, gradient, voxel))
        continue;
      block.distance[lane] = std::min(distance, block.distance[lane]);
      block.gradient_x[lane] = gradient.x();
      block.gradient_y[lane] = gradient.y();
      block.gradient_z[lane] = gradient.z();
      sums.smallest_distance = std::min(sums.smallest_distance, block.distance[lane]);
    }
  }
}

structures::FieldSample correctedSample(const structures::DistanceField& field,
                                        const Vector3& p_MP) noexcept {
  structures::FieldSample sample = field.sample(p_MP);
  const double dilation = field.dilationAt(p_MP);
  if (!sample.exact || !(sample.distance < 0.0)) {
    sample.distance += dilation;
    return sample;
  }
  // a pointshell of one point at its origin, so that P is not rounded
  const LaneFrame frame(field, Pose(p_MP), Pose(), 0.0, 0.0);
  alignas(64) static constexpr std::array<float, structures::ShellBlock::kLanes> kOrigins{};
  const PointLanes points{kOrigins.data(), kOrigins.data(), kOrigins.data(), 1};
  std::array<SampleLanes, 1> samples;
  SampleSums sums;
  chosenKernels().samples(frame, points, samples.data(), sums);
  correctRidges(frame, chosenKernels(), points, samples, sums);
  const SampleLanes& lanes = samples.front();
  sample.distance = lanes.distance[0] + dilation;
  sample.gradient = {lanes.gradient_x[0], lanes.gradient_y[0], lanes.gradient_z[0]};
  return sample;
}

}  // namespace tenon::collision
