#include "server/collision/valley_correction.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "idl/types/fixed_vector.h"
#include "server/collision/tangent_probes.h"

namespace tenon::collision {

namespace {

/// [voxels] Distances in which the interpolation error matters.
constexpr double kDeepest = -1.0;
constexpr double kFarthest = 0.75;

/// [-] Probes that see one face alone, or a rounded one, are tried again farther away.
constexpr std::array kProbeScales{1.0, 1.4};

/// [voxels] The point's distance from a plane of its cell may be so much less, or more, than the
/// interpolation.
constexpr double kBelow = 0.05;
constexpr double kAbove = 1.5;

/// [voxels] The samples of the cell are those of the planes within this.
constexpr double kFit = 0.1;

/// [voxels] Smaller errors are not worth a normal's jump.
constexpr double kLeastError = 2e-3;

/// A half-space of free space, around a point.
struct Plane {
  Vector3 n;        ///< [-] into free space
  double distance;  ///< [voxels] of the point
  [[nodiscard]] double at(const Vector3& offset) const { return distance + n.dot(offset); }
};
using Planes = FixedVector<Plane, 4>;

/// The planes at probes, of each direction the one whose gradient is nearest to unit length; the nearest
/// planes first.
Planes choosePlanes(const TangentPlanes& tangent, double interpolated, double voxel) {
  const auto deviation = [&tangent](std::size_t k) {
    return std::abs(gradientOf(tangent, k).squaredNorm() - 1.0);
  };
  FixedVector<std::size_t, ProbeOffsets::kProbes> chosen;
  for (std::size_t k = 0; k < ProbeOffsets::kProbes; ++k) {
    const double distance = tangent.distance[k] / voxel;
    // false for kNoPlane
    if (!(distance >= interpolated - kBelow && distance <= interpolated + kAbove)) continue;
    const auto same = std::find_if(chosen.begin(), chosen.end(), [&](std::size_t other) {
      return gradientOf(tangent, other).dot(gradientOf(tangent, k)) > kSameNormal;
    });
    if (same == chosen.end()) {
      chosen.push_back(k);
    } else if (deviation(k) < deviation(*same)) {
      *same = k;
    }
  }
  std::sort(chosen.begin(), chosen.end(), [&tangent](std::size_t a, std::size_t b) {
    return tangent.distance[a] != tangent.distance[b] ? tangent.distance[a] < tangent.distance[b] : a < b;
  });
  Planes planes;
  for (const std::size_t k : chosen)
    planes.push_back({gradientOf(tangent, k).normalized(), tangent.distance[k] / voxel});
  return planes;
}

/// [voxels] Distance of a point to the intersection of the half-spaces: of pairs of them, the farthest.
double distanceOf(const Planes& planes, const Vector3& offset) {
  std::array<double, Planes::capacity()> at;
  double lowest = kFarGap;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    at[i] = planes[i].at(offset);
    lowest = std::min(lowest, at[i]);
  }
  if (lowest >= 0.0) return lowest;
  for (std::size_t i = 1; i < planes.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double cosine = planes[i].n.dot(planes[j].n);
      // the nearest point is on one of both planes, unless its other side is outside of the other one
      if (at[i] - cosine * at[j] >= 0.0 || at[j] - cosine * at[i] >= 0.0) continue;
      const double sine2 = 1.0 - cosine * cosine;
      if (sine2 < 1e-3) continue;
      const double squared = (at[i] * at[i] + at[j] * at[j] - 2.0 * cosine * at[i] * at[j]) / sine2;
      lowest = std::min(lowest, -std::sqrt(squared));
    }
  }
  return lowest;
}

/// Whether a sample in the corner has the wrong sign: by the planes it is `there` [voxels] outside.
bool hasWrongSign(double sample, double there) {
  constexpr double kMost = 0.3;  // [voxels]
  return there > 0.0 && there < kMost && sample < there && sample > -there - kFit;
}

/// [voxels] Error of the trilinear interpolation at the cell's point, at most 0, with samples of the wrong
/// sign as they are; 0 where the cell's samples are not those of the planes.
double interpolationError(const structures::FieldCell& cell, const Planes& planes) {
  double interpolated = 0.0;
  for (unsigned k = 0; k < 8; ++k) {
    const Vector3 corner(k & 1U, k >> 1U & 1U, k >> 2U & 1U);
    double there = distanceOf(planes, corner - cell.p_cell);
    if (std::abs(there - cell.samples[k]) > kFit) {
      if (!hasWrongSign(cell.samples[k], there)) return 0.0;
      there = cell.samples[k];
    }
    const Vector3 weight = (corner - (Vector3::Ones() - cell.p_cell)).cwiseAbs();
    interpolated += there * (weight.x() * weight.y() * weight.z());
  }
  return std::min(interpolated - planes[0].distance, 0.0);
}

/// A sample in a cell whose surface is known: the gap to the nearest plane, which also holds the point where
/// it is behind more than one.
structures::FieldSample nearestPlane(std::span<const structures::ValleyPlane> planes,
                                     const Vector3& p_FoP_M) {
  structures::FieldSample sample{kFarGap, Vector3::Zero(), true};
  for (const structures::ValleyPlane& plane : planes) {
    const double distance = plane.distance(p_FoP_M);
    if (distance < sample.distance) sample = {distance, plane.n_M.cast<double>(), true};
  }
  return sample;
}

}  // namespace

bool correctValley(const LaneFrame& frame, const QueryKernels& kernels, const Vector3& p_BP,
                   structures::FieldSample& sample) noexcept {
  const structures::DistanceField& field = frame.field;
  if (const auto planes = field.planesAt(p_BP); !planes.empty()) {
    sample = nearestPlane(planes, p_BP - field.layout().p_MoFo_M);
    return true;
  }
  if (std::abs(sample.gradient.squaredNorm() - 1.0) <= kUnitSlope) return false;
  structures::FieldCell cell;
  if (!field.cellAt(p_BP, cell)) return false;
  const double interpolated = sample.distance / cell.voxel;
  if (interpolated < kDeepest || interpolated > kFarthest) return false;
  const ProbeOffsets offsets = probeOffsets(kProbeDistance * field.voxel());
  for (const double scale : kProbeScales) {
    TangentPlanes tangent;
    kernels.tangent_planes(frame, offsets, p_BP, scale * cell.voxel / field.voxel(), tangent);
    const Planes planes = choosePlanes(tangent, interpolated, cell.voxel);
    // beside a convex edge all planes are nearer
    if (planes.empty()) return false;
    const double error = planes.size() < 2 ? 0.0 : interpolationError(cell, planes);
    if (error > -kLeastError) continue;
    sample.distance -= error * cell.voxel;
    sample.gradient = planes[0].n;
    return true;
  }
  return false;
}

structures::FieldSample sampleInValley(const structures::DistanceField& field, const Vector3& p_MP) noexcept {
  structures::FieldSample sample = field.sample(p_MP);
  if (!sample.exact || !mayBeInValley(field, sample.distance, sample.gradient.squaredNorm())) return sample;
  const LaneFrame frame(field, Pose(), Pose(), 0.0, 0.0);
  correctValley(frame, chosenKernels(), p_MP, sample);
  return sample;
}

}  // namespace tenon::collision
