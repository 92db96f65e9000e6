#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/bake/brick_level.h"

namespace tenon::bake {

class ParallelWork;

/// A mark for each coarse brick.
///
/// Threads: constant.
class BrickMarks {
 public:
  BrickMarks() = default;
  BrickMarks(const BrickLevel& coarse, std::vector<std::uint8_t> marks)
      : p_MoFo_M_(coarse.p_MoFo_M),
        edge_(coarse.voxel * BrickLevel::kVoxels),
        bricks_(coarse.bricks),
        marks_(std::move(marks)) {}

  /// Takes the marks away that `other` has not.
  void keepThoseOf(const BrickMarks& other) {
    std::transform(marks_.begin(), marks_.end(), other.marks_.begin(), marks_.begin(),
                   [](std::uint8_t a, std::uint8_t b) { return std::min(a, b); });
  }
  [[nodiscard]] bool operator[](std::size_t node) const { return marks_[node] != 0; }
  /// Of the brick that a point lies in.
  [[nodiscard]] bool at(const Vector3& p_MP) const { return marks_[nodeOf(brickAt(p_MP))] != 0; }
  /// Whether a brick that the box intersects is marked; true, unseen, for a box of very many bricks.
  [[nodiscard]] bool anyIn(const Eigen::AlignedBox3d& box_M) const;

 private:
  [[nodiscard]] BrickLevel::Cell brickAt(const Vector3& p_MP) const {
    const BrickLevel::Cell cell = ((p_MP - p_MoFo_M_) / edge_).array().floor().matrix().cast<int>();
    return cell.cwiseMax(0).cwiseMin(bricks_ - BrickLevel::Cell::Ones());
  }
  [[nodiscard]] std::size_t nodeOf(const BrickLevel::Cell& brick) const {
    const auto nx = static_cast<std::size_t>(bricks_.x());
    const auto ny = static_cast<std::size_t>(bricks_.y());
    return (static_cast<std::size_t>(brick.z()) * ny + static_cast<std::size_t>(brick.y())) * nx +
           static_cast<std::size_t>(brick.x());
  }

  Vector3 p_MoFo_M_ = Vector3::Zero();
  double edge_ = 1.0;  // [m]
  BrickLevel::Cell bricks_ = BrickLevel::Cell::Zero();
  std::vector<std::uint8_t> marks_;
};

/// Marks the bricks where material may be thin: some sample at the surface has none within two voxels that is
/// 1.05 voxels inside. No wall of less than two voxels is missed, but at its end, up to two voxels from where
/// it widens.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] BrickMarks thinBricks(const BrickLevel& coarse, ParallelWork& work);

}  // namespace tenon::bake
