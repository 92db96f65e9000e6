#pragma once

#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "server/structures/distance_field.h"

namespace tenon::bake {

class ParallelWork;
class TriangleTree;

/// The bricks of one voxel size while a field is baked: the whole grid, or the children of its refined
/// bricks.
///
/// A brick is a node with a number. Nodes near triangles have a slot with 9^3 samples; the others contain no
/// surface and are entirely free or entirely solid. Lattice points have integer coordinates from the grid's
/// corner [voxels of this level]; a lattice point on the face between two bricks belongs to the upper one.
///
/// Threads: one caller at a time; functions with a ParallelWork parameter use several threads inside.
class BrickLevel {
 public:
  static constexpr int kVoxels = structures::DistanceField::kBrickVoxels;
  static constexpr double kBrickRadius = structures::DistanceField::kBrickRadius;  ///< [voxels]
  static constexpr int kSide = structures::DistanceField::kBrickSide;
  static constexpr int kSamples = structures::DistanceField::kBrickSamples;
  using Cell = Eigen::Vector3i;
  using Mask = std::array<std::uint64_t, kVoxels>;  ///< 8^3 own samples: one word per z, bit y * 8 + x
  using SampleBits = std::bitset<kSamples>;

  /// The state of one lattice point.
  struct Point {
    bool known = false;     ///< the point is in this level
    bool free = false;      ///< outside: connected to the grid's border
    bool reached = false;   ///< by the flood fill itself, not by its extension to the surface
    double distance = 0.0;  ///< [voxels] unsigned
  };

  /// The whole grid, with edge `voxel` [m].
  BrickLevel(const Vector3& p_MoFo_M, double voxel, const Cell& bricks);
  /// By corner of a brick (x fastest), an upper bound of the dilation there [coarse voxels].
  using CornerDilations = std::array<float, 8>;
  /// The children of the bricks `refined` of `coarse`, with bands that reach beyond the dilation.
  BrickLevel(const BrickLevel& coarse, int refinement, std::span<const std::uint32_t> refined,
             std::span<const CornerDilations> dilations);

  /// -1 where this level has no brick.
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
  /// [voxels] |distance| up to which samples of a node are exact, and where they are clamped.
  [[nodiscard]] double bandOf(std::size_t node) const {
    return structures::DistanceField::kBandVoxels +
           (beyond_.empty() ? 0.0 : static_cast<double>(beyond_[node]));
  }
  [[nodiscard]] double clampOf(std::size_t node) const {
    return bandOf(node) + structures::DistanceField::kClampVoxels - structures::DistanceField::kBandVoxels;
  }
  [[nodiscard]] Point at(const Cell& lattice) const;
  /// What Point states follow from, of one brick.
  struct BrickState {
    bool known = false;
    bool free = false;                      ///< without samples: entirely outside
    const std::int16_t* samples = nullptr;  ///< null: no surface near
    const SampleBits* outside = nullptr;
    const Mask* reached = nullptr;
    [[nodiscard]] Point at(const Cell& in_brick) const;
  };
  /// `node` < 0: not in this level.
  [[nodiscard]] BrickState brickAt(std::int64_t node) const;
  /// Calls visit(offset from the brick's corner, point) for the lattice points of a brick, `below` layers
  /// under it and `above` layers over it. Looks up each neighbouring brick once.
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
  /// Calls visit(from, to) for blocks of up to 4^3 samples of a brick, `to` beyond the last.
  template <typename Visit>
  static void forEachBlock(Visit&& visit) {
    for (int block = 0; block < 27; ++block) {
      const Cell from = Cell(block % 3, block / 3 % 3, block / 9) * 4;
      visit(from, Cell((from + Cell::Constant(4)).cwiseMin(kSide)));
    }
  }
  /// Calls visit(sample, its cell) for the samples of a block.
  template <typename Visit>
  static void forEachSample(const Cell& from, const Cell& to, Visit&& visit) {
    for (int z = from.z(); z < to.z(); ++z) {
      for (int y = from.y(); y < to.y(); ++y) {
        for (int x = from.x(); x < to.x(); ++x) visit(sampleIndex({x, y, z}), Cell(x, y, z));
      }
    }
  }
  /// The middle of a block, and how far its samples are from there [m].
  [[nodiscard]] Vector3 middleOf(const Cell& from, const Cell& to) const {
    return p_MoFo_M + (from + to - Cell::Ones()).cast<double>() / 2 * voxel;
  }
  [[nodiscard]] double radiusOf(const Cell& from, const Cell& to) const {
    return (to - from - Cell::Ones()).cast<double>().norm() / 2 * voxel;
  }
  /// [voxels] The trilinear distance at a point in a brick with a slot, `p` [voxels] from its corner.
  [[nodiscard]] double interpolated(std::size_t node, const Vector3& p) const;
  /// The sample at a lattice point, from any brick that contains it; null where none does.
  [[nodiscard]] const std::int16_t* findSample(const Cell& lattice) const;
  /// Sets the sample in every brick that contains it, and sets `marks` of their nodes to 1.
  void setSample(const Cell& lattice, std::int16_t value, std::span<std::uint8_t> marks);

  /// Gives a slot to the bricks near triangles and samples their unsigned distances. Returns the number of
  /// these bricks; when it is more than `most`, nothing was sampled.
  std::size_t sampleDistances(const TriangleTree& tree, std::size_t most, ParallelWork& work);
  /// Sets the samples `which` of a node to the unsigned distance to the nearest triangle.
  void sampleBrick(std::size_t node, const TriangleTree& tree, const SampleBits& which);
  /// Copies the apron samples (on the upper faces) from the neighbours that own them.
  void copyApron(std::size_t node);
  /// The samples of a brick that it owns: those of no neighbour with a slot.
  [[nodiscard]] SampleBits ownSamples(std::size_t node) const;

  Vector3 p_MoFo_M;
  double voxel;  ///< [m]
  Cell bricks;
  int refinement = 1;
  std::vector<std::int32_t> slot;     ///< per node; < 0: no surface near
  std::vector<std::uint8_t> free;     ///< per node: 1 when it has no slot and is outside
  std::vector<std::int16_t> samples;  ///< kSamples per slot [voxels / kQuantaPerVoxel]
  std::vector<Mask> reached;          ///< per slot: reached by the flood fill from outside
  std::vector<SampleBits> outside;    ///< per slot: the samples that are outside, apron included

 private:
  /// Calls visit(node, sample) for each brick with a slot that contains this lattice point, until it returns
  /// false.
  template <typename Visit>
  void visitCopies(const Cell& lattice, Visit&& visit) const;

  [[nodiscard]] std::size_t childrenOfBlock() const {
    const auto r = static_cast<std::size_t>(refinement);
    return r * r * r;
  }

  Cell coarse_bricks_;
  std::vector<std::int32_t> block_of_coarse_;  // fine level only: the number of the block of children, or -1
  std::vector<std::uint32_t> coarse_of_block_;
  std::vector<float> beyond_;  // fine level only: per node, how much its band is deeper [voxels]
};

inline BrickLevel::BrickState BrickLevel::brickAt(std::int64_t node) const {
  BrickState brick;
  if (node < 0) return brick;
  brick.known = true;
  const std::int32_t of_slot = slot[static_cast<std::size_t>(node)];
  if (of_slot < 0) {
    brick.free = free[static_cast<std::size_t>(node)] != 0;
    return brick;
  }
  const auto s = static_cast<std::size_t>(of_slot);
  brick.samples = samplesOf(of_slot);
  if (!outside.empty()) brick.outside = &outside[s];
  if (!reached.empty()) brick.reached = &reached[s];
  return brick;
}

inline BrickLevel::Point BrickLevel::BrickState::at(const Cell& in_brick) const {
  Point point;
  point.known = known;
  if (samples == nullptr) {
    point.free = point.reached = free;
    point.distance = known ? structures::DistanceField::kBandVoxels : 0.0;
    return point;
  }
  const int sample = sampleIndex(in_brick);
  point.distance =
      std::abs(static_cast<double>(samples[sample])) / structures::DistanceField::kQuantaPerVoxel;
  if (outside != nullptr) point.free = (*outside)[static_cast<std::size_t>(sample)];
  if (reached != nullptr) {
    const std::uint64_t word = (*reached)[static_cast<std::size_t>(in_brick.z())];
    point.reached = (word >> static_cast<unsigned>(in_brick.y() * kVoxels + in_brick.x()) & 1U) != 0;
  }
  return point;
}

template <typename Visit>
void BrickLevel::visitAround(std::size_t node, int below, int above, Visit&& visit) const {
  const Cell brick = brickOf(node);
  for (int neighbour = 0; neighbour < 27; ++neighbour) {
    const Cell brick_offset = Cell(neighbour % 3, neighbour / 3 % 3, neighbour / 9) - Cell::Ones();
    const auto first = [&](int axis) { return brick_offset[axis] < 0 ? kVoxels - below : 0; };
    const auto end = [&](int axis) { return brick_offset[axis] > 0 ? above : kVoxels; };
    const BrickState from =
        brickAt(brick_offset.isZero() ? static_cast<std::int64_t>(node) : nodeAt(brick + brick_offset));
    for (int z = first(2); z < end(2); ++z) {
      for (int y = first(1); y < end(1); ++y) {
        for (int x = first(0); x < end(0); ++x) {
          const Cell in_brick(x, y, z);
          visit(Cell(in_brick + brick_offset * kVoxels), from.at(in_brick));
        }
      }
    }
  }
}

}  // namespace tenon::bake
