#pragma once

#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "server/structures/distance_field.h"

namespace tenon {

class ParallelWork;
class TriangleTree;

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
  [[nodiscard]] Vector3 centreOf(std::size_t node) const {
    return position(brickOf(node) * kVoxels + Cell::Constant(kVoxels / 2));
  }
  [[nodiscard]] Cell cellAt(const Vector3& p_MP) const {
    return ((p_MP - p_MoFo_M) / voxel).array().floor().matrix().cast<int>();
  }
  [[nodiscard]] Point at(const Cell& lattice) const;
  /// The same for a point of a brick that is known by its node (< 0: not in this level).
  [[nodiscard]] Point at(std::int64_t node, const Cell& in_brick) const;
  /// Calls visit(offset, point) for the lattice points from `below` under a brick's corner to `above` over
  /// its last own one; each of the bricks they lie in is found once.
  template <typename Visit>
  void visitAround(std::size_t node, int below, int above, Visit&& visit) const;
  [[nodiscard]] std::int16_t* samplesOf(std::int32_t of_slot) {
    return samples.data() + static_cast<std::size_t>(of_slot) * kSamples;
  }
  [[nodiscard]] const std::int16_t* samplesOf(std::int32_t of_slot) const {
    return samples.data() + static_cast<std::size_t>(of_slot) * kSamples;
  }
  [[nodiscard]] static int sampleIndex(const Cell& in_brick) {
    return (in_brick.z() * kSide + in_brick.y()) * kSide + in_brick.x();
  }
  [[nodiscard]] static Cell cellOfSample(int sample) {
    return {sample % kSide, sample / kSide % kSide, sample / (kSide * kSide)};
  }
  /// The sample at a lattice point, from any brick that has it; null where none does.
  [[nodiscard]] const std::int16_t* findSample(const Cell& lattice) const;
  /// Sets it in all of them, and marks their nodes.
  void setSample(const Cell& lattice, std::int16_t value, std::span<std::uint8_t> marks);
  [[nodiscard]] bool anyOutside(std::size_t node) const {
    return slot[node] < 0 ? free[node] != 0 : outside[static_cast<std::size_t>(slot[node])].any();
  }

  /// Finds the bricks near triangles and samples their distances. False when there is no room for them.
  bool sampleDistances(const TriangleTree& tree, ParallelWork& work);
  /// Measures those samples of one node that it has alone or owns, from a tree of triangles.
  void sampleBrick(std::size_t node, const TriangleTree& tree, const SampleBits& which);
  /// Takes the samples on the upper faces from the neighbours that own them.
  void copyApron(std::size_t node);
  /// Which samples of a brick no neighbour with a slot has as its own.
  [[nodiscard]] SampleBits ownSamples(std::size_t node) const;

  Vector3 p_MoFo_M;
  double voxel;
  Cell bricks;
  int refinement = 1;
  std::vector<std::int32_t> slot;     ///< per node; < 0: no surface near
  std::vector<std::uint8_t> free;     ///< per node without slot
  std::vector<std::int16_t> samples;  ///< per slot
  std::vector<Mask> reached;          ///< per slot: flooded from outside
  std::vector<SampleBits> outside;    ///< per slot, apron included

 private:
  /// Calls visit(node, sample) for each brick with samples that has this lattice point, until it says no.
  template <typename Visit>
  void visitCopies(const Cell& lattice, Visit&& visit) const;

  Cell coarse_bricks_;
  std::vector<std::int32_t> block_of_coarse_;  // fine level only: which block of children, or -1
  std::vector<std::uint32_t> coarse_of_block_;
};

inline BrickLevel::Point BrickLevel::at(std::int64_t node, const Cell& in_brick) const {
  if (node < 0) return {};
  Point point;
  point.known = true;
  const std::int32_t of_slot = slot[static_cast<std::size_t>(node)];
  if (of_slot < 0) {
    point.free = point.reached = free[static_cast<std::size_t>(node)] != 0;
    point.distance = DistanceField::kBandVoxels;
    return point;
  }
  const int sample = sampleIndex(in_brick);
  point.distance = std::abs(static_cast<double>(samplesOf(of_slot)[sample])) / DistanceField::kQuantaPerVoxel;
  const auto s = static_cast<std::size_t>(of_slot);
  if (!outside.empty()) point.free = outside[s][static_cast<std::size_t>(sample)];
  if (!reached.empty()) {
    const std::uint64_t word = reached[s][static_cast<std::size_t>(in_brick.z())];
    point.reached = (word >> static_cast<unsigned>(in_brick.y() * kVoxels + in_brick.x()) & 1U) != 0;
  }
  return point;
}

template <typename Visit>
void BrickLevel::visitAround(std::size_t node, int below, int above, Visit&& visit) const {
  const Cell brick = brickOf(node);
  for (int neighbour = 0; neighbour < 27; ++neighbour) {
    const Cell aside = Cell(neighbour % 3, neighbour / 3 % 3, neighbour / 9) - Cell::Ones();
    const auto first = [&](int axis) { return aside[axis] < 0 ? kVoxels - below : 0; };
    const auto end = [&](int axis) { return aside[axis] > 0 ? above : kVoxels; };
    const std::int64_t there = aside.isZero() ? static_cast<std::int64_t>(node) : nodeAt(brick + aside);
    for (int z = first(2); z < end(2); ++z) {
      for (int y = first(1); y < end(1); ++y) {
        for (int x = first(0); x < end(0); ++x) {
          const Cell in_brick(x, y, z);
          visit(Cell(in_brick + aside * kVoxels), at(there, in_brick));
        }
      }
    }
  }
}

}  // namespace tenon
