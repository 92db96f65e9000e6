#include "server/structures/volume.h"

#include <algorithm>

namespace tenon {
namespace {

/// Sums of shares of voxels, their first and second moments about one point.
struct Moments {
  double share = 0.0;
  Vector3 first = Vector3::Zero();
  Matrix3 second = Matrix3::Zero();

  void add(double weight, const Vector3& p) {
    share += weight;
    first += weight * p;
    second += weight * (p * p.transpose());
  }
};

void addBrick(const DistanceField& field, const Vector3& corner, const Vector3& p_MR, Moments& sum) {
  const double h = field.voxel();
  for (int z = 0; z < DistanceField::kBrickVoxels; ++z) {
    for (int y = 0; y < DistanceField::kBrickVoxels; ++y) {
      for (int x = 0; x < DistanceField::kBrickVoxels; ++x) {
        const Vector3 p_MP = corner + h * Vector3(x + 0.5, y + 0.5, z + 0.5);
        const double share = std::clamp(0.5 - field.sample(p_MP).distance / h, 0.0, 1.0);
        if (share > 0.0) sum.add(share, p_MP - p_MR);
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
  Moments sum;
  std::size_t number = 0;
  for (int z = 0; z < layout.bricks[2]; ++z) {
    for (int y = 0; y < layout.bricks[1]; ++y) {
      for (int x = 0; x < layout.bricks[0]; ++x, ++number) {
        if (layout.index[number] == DistanceField::kFarOutside) continue;
        addBrick(field, layout.p_MoFo_M + edge * Vector3(x, y, z), p_MR, sum);
      }
    }
  }
  if (sum.share <= 0.0) return result;
  const double h = field.voxel();
  const double cell = h * h * h;
  const Vector3 p_RC = sum.first / sum.share;
  // of points, and of the voxels' own size
  const Matrix3 spread = cell * (sum.second - sum.share * (p_RC * p_RC.transpose())) +
                         (cell * sum.share * h * h / 12.0) * Matrix3::Identity();
  result.volume = cell * sum.share;
  result.p_MC_M = p_MR + p_RC;
  result.inertia_C_M = spread.trace() * Matrix3::Identity() - spread;
  return result;
}

}  // namespace tenon
