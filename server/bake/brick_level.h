#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/triangle.h"
#include "server/structures/distance_field.h"

namespace tenon {

class ParallelWork;

/// The bricks of one voxel size while a field is baked: the whole grid, or the children of its refined
/// bricks.
///
/// A brick is a node, known by number. Nodes near triangles have a slot with 9^3 unsigned samples; the others
/// hold no surface and are all free or all solid. Lattice points are counted from the grid's corner in voxels
/// of this level; a point belongs to the brick whose lower faces it may lie on.
///
/// Threads: one step at a time; ParallelWork inside.
class BrickLevel {
 public:
  static constexpr int kVoxels = DistanceField::kBrickVoxels;
  static constexpr double kBrickRadius = 6.9283;  ///< [voxels] from a brick's centre to its corner
  static constexpr int kSide = DistanceField::kBrickSide;
  static constexpr int kSamples = DistanceField::kBrickSamples;
  using Cell = Eigen::Vector3i;
  using Mask = std::array<std::uint64_t, kVoxels>;  ///< own samples: a word for each z, bit y * 8 + x
  using SampleBits = std::bitset<kSamples>;

  /// What is known of one lattice point.
  struct Point {
    bool known = false;     ///< the point is in this level
    bool free = false;      ///< connected to the outside
    bool reached = false;   ///< by the flood itself, not by its extension
    double distance = 0.0;  ///< [voxel] unsigned
  };

  /// The whole grid.
  BrickLevel(const Vector3& p_MoFo_M, double voxel, const Cell& bricks);
  /// The children of some bricks of `coarse`.
  BrickLevel(const BrickLevel& coarse, int refinement, std::span<const std::uint32_t> refined);

  [[nodiscard]] std::int64_t nodeAt(const Cell& brick) const;
  [[nodiscard]] Cell brickOf(std::size_t node) const;
  [[nodiscard]] std::size_t nodes() const { return slot.size(); }
  [[nodiscard]] Vector3 position(const Cell& lattice) const {
    return p_MoFo_M + lattice.cast<double>() * voxel;
  }
  [[nodiscard]] Cell cellAt(const Vector3& p_MP) const {
    return ((p_MP - p_MoFo_M) / voxel).array().floor().matrix().cast<int>();
  }
  [[nodiscard]] Point at(const Cell& lattice) const;
  [[nodiscard]] std::int16_t* samplesOf(std::int32_t of_slot) {
    return samples.data() + static_cast<std::size_t>(of_slot) * kSamples;
  }
  [[nodiscard]] const std::int16_t* samplesOf(std::int32_t of_slot) const {
    return samples.data() + static_cast<std::size_t>(of_slot) * kSamples;
  }
  [[nodiscard]] static int sampleIndex(const Cell& in_brick) {
    return (in_brick.z() * kSide + in_brick.y()) * kSide + in_brick.x();
  }
  [[nodiscard]] std::span<const std::uint32_t> near(std::size_t node) const {
    return {near_triangles.data() + near_first[node], near_first[node + 1] - near_first[node]};
  }

  /// Lists the triangles within kClampVoxels of each brick. False when there is no room for the lists.
  bool listTriangles(std::span<const Triangle> triangles, ParallelWork& work);
  /// Samples the distance to the listed triangles. False when there is no room for the bricks.
  bool sampleDistances(std::span<const Triangle> triangles, ParallelWork& work);
  /// Samples of one node, and where `which` says so, again from other triangles (given by value).
  void sampleBrick(std::size_t node, std::span<const Triangle> triangles, const SampleBits* which,
                   std::int16_t* out) const;

  Vector3 p_MoFo_M;
  double voxel;
  Cell bricks;
  int refinement = 1;
  std::vector<std::int32_t> slot;       ///< per node; < 0: no surface near
  std::vector<std::uint8_t> free;       ///< per node without slot
  std::vector<std::int16_t> samples;    ///< per slot
  std::vector<Mask> reached;            ///< per slot: flooded from outside
  std::vector<SampleBits> outside;      ///< per slot, apron included
  std::vector<std::size_t> near_first;  ///< per node, into near_triangles
  std::vector<std::uint32_t> near_triangles;

 private:
  template <typename Visit>
  void visitNear(const Triangle& triangle, int z_begin, int z_end, Visit&& visit) const;

  Cell coarse_bricks_;
  std::vector<std::int32_t> block_of_coarse_;  // fine level only: which block of children, or -1
  std::vector<std::uint32_t> coarse_of_block_;
};

}  // namespace tenon
