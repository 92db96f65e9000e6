#pragma once

#include "server/structures/distance_field.h"

namespace tenon::bake {

/// Determines inward normals and edge convexity from the field.
///
/// Threads: constant. Real-time: no; used while structures are baked.
class NormalEstimator {
 public:
  explicit NormalEstimator(const structures::DistanceField& field) : field_(field) {}

  /// The inward normal at a surface point. `normal_M` of the triangle, of either sign, is used where the
  /// gradient is not reliable, and gives the side on a sheet.
  [[nodiscard]] Vector3 inward(const Vector3& p_MP, const Vector3& normal_M) const {
    // compare both sides at a distance: in a thin plate the gradient may be that of the other face
    const Vector3 step = normal_M * (0.75 * field_.voxelAt(p_MP));
    const bool outwards = field_.sample(p_MP + step).distance >= field_.sample(p_MP - step).distance;
    const Vector3 inward_M = outwards ? Vector3(-normal_M) : normal_M;
    const structures::FieldSample sample = field_.sample(p_MP);
    const double slope = sample.gradient.norm();
    constexpr double kMinGradient = 0.3;  // [-] less is near the medial axis: not the surface normal
    if (!sample.exact || slope < kMinGradient || -sample.gradient.dot(inward_M) < 0.5 * slope)
      return inward_M;
    return -sample.gradient / slope;
  }

  [[nodiscard]] bool onSurface(const Vector3& p_MP) const {
    return field_.sample(p_MP).distance > -0.5 * field_.voxelAt(p_MP);
  }

  /// Whether an edge is convex: the solid is in the direction `into_M`, the bisector of its faces.
  [[nodiscard]] bool convex(const Vector3& p_MP, const Vector3& into_M) const {
    const Vector3 step = into_M * (0.5 * field_.voxelAt(p_MP));
    return field_.sample(p_MP + step).distance <= field_.sample(p_MP - step).distance;
  }

 private:
  const structures::DistanceField& field_;
};

}  // namespace tenon::bake
