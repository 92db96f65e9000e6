#pragma once

#include <array>
#include <cstddef>

#include "server/collision/query_kernels.h"

namespace tenon::collision {

/// [voxels] From a point to its probes: far enough to cross the middle of a wall of up to four voxels, and
/// the surface of a thinner one.
inline constexpr double kProbeDistance = 2.0;

/// [-] Cosine of 8 degrees: gradients at probes that see one face.
inline constexpr double kSameNormal = 0.99;

/// Offsets of `length` [m]. Their directions are those of the corners of a cube rotated by 0.6 rad about
/// (1, 2, 3), so that none is along an axis or a diagonal of the grid; the other four are their negatives.
[[nodiscard]] inline ProbeOffsets probeOffsets(double length) {
  constexpr std::array<std::array<double, 3>, ProbeOffsets::kProbes / 2> kDirections{
      {{0.43260, 0.73720, 0.51904},
       {-0.53482, 0.18563, 0.82432},
       {0.92654, -0.27344, 0.25835},
       {0.04088, 0.82501, -0.56363}}};
  ProbeOffsets offsets;
  for (std::size_t k = 0; k < ProbeOffsets::kProbes; ++k) {
    const auto& [x, y, z] = kDirections[k / 2];
    const double along = k % 2 == 0 ? length : -length;
    offsets.x[k] = along * x;
    offsets.y[k] = along * y;
    offsets.z[k] = along * z;
  }
  return offsets;
}

[[nodiscard]] inline Vector3 gradientOf(const TangentPlanes& planes, std::size_t k) {
  return {planes.gradient_x[k], planes.gradient_y[k], planes.gradient_z[k]};
}

}  // namespace tenon::collision
