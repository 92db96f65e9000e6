#include "server/structures/volume.h"

#include <algorithm>

namespace tenon::structures {
namespace {

/// Sum of the filled fractions of voxels, and their first and second moments about one point.
struct VoxelMoments {
  double fraction = 0.0;
  Vector3 first = Vector3::Zero();
  Matrix3 second = Matrix3::Zero();

  void add(double weight, const Vector3& p) {
    fraction += weight;
    first += weight * p;
    second += weight * (p * p.transpose());
  }
};

void addBrick(const DistanceField& field, const Vector3& corner, const Vector3& p_MR, VoxelMoments& sum) {
  const double h = field.voxel();
  for (int z = 0; z < DistanceField::kBrickVoxels; ++z) {
    for (int y = 0; y < DistanceField::kBrickVoxels; ++y) {
      for (int x = 0; x < DistanceField::kBrickVoxels; ++x) {
        const Vector3 p_MP = corner + h * Vector3(x + 0.5, y + 0.5, z + 0.5);
        const double fraction = std::clamp(0.5 - field.undilated(p_MP).distance / h, 0.0, 1.0);
        if (fraction > 0.0) sum.add(fraction, p_MP - p_MR);
      }
    }
  }
}

}  // namespace

Volume volumeOf(const DistanceField& field) {
  Volume result;
  if (field.empty()) return result;
  const DistanceField::Layout& layout = field.layout();
  const double edge = field.voxel() * DistanceField::kBrickVoxels;
  const Vector3 p_MR = field.box().center();
  VoxelMoments sum;
  std::size_t number = 0;
  for (int z = 0; z < layout.bricks[2]; ++z) {
    for (int y = 0; y < layout.bricks[1]; ++y) {
      for (int x = 0; x < layout.bricks[0]; ++x, ++number) {
        if (layout.index[number] == DistanceField::kFarOutside) continue;
        addBrick(field, layout.p_MoFo_M + edge * Vector3(x, y, z), p_MR, sum);
      }
    }
  }
  if (sum.fraction <= 0.0) return result;
  const double h = field.voxel();
  const double cell = h * h * h;
  const Vector3 p_RC = sum.first / sum.fraction;
  // second moment of the voxel centres about the centroid, and that of the voxels themselves
  const Matrix3 spread = cell * (sum.second - sum.fraction * (p_RC * p_RC.transpose())) +
                         (cell * sum.fraction * h * h / 12.0) * Matrix3::Identity();
  result.volume = cell * sum.fraction;
  result.p_MC_M = p_MR + p_RC;
  result.inertia_C_M = spread.trace() * Matrix3::Identity() - spread;
  return result;
}

}  // namespace tenon::structures
