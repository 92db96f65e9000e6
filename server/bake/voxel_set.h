#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <map>

#include "idl/types/result.h"
#include "server/structures/distance_field.h"

namespace tenon::bake {

/// The filled cells of a cubic grid in W: cell (i, j, k) has its lowest corner at (i, j, k) times the edge.
///
/// Stored as bits in sparse blocks of 8^3 cells. A cell is filled when its centre is inside, so volumes are
/// unbiased for any cell size.
///
/// Threads: one. Real-time: no.
class VoxelSet {
 public:
  static constexpr int kBlock = 8;
  using Cell = Eigen::Vector3i;

  /// Cells with edge `cell` [m].
  explicit VoxelSet(double cell) : cell_(cell) {}

  /// Fills the cells whose centre is inside a solid at X_WM, or less than `dilation` [m] outside (at most the
  /// field's band). False when there are too many blocks, or the solid is too far from the origin.
  [[nodiscard]] bool add(const structures::DistanceField& field, const Pose& X_WM, double dilation = 0.0);

  /// [m] Edge of a cell.
  [[nodiscard]] double cell() const { return cell_; }
  [[nodiscard]] std::size_t count() const;
  /// [m^3]
  [[nodiscard]] double volume() const { return static_cast<double>(count()) * cell_ * cell_ * cell_; }
  /// Calls visit(cell) for each filled cell, always in the same order.
  template <typename Visit>
  void visit(Visit&& visit) const;

 private:
  using Bits = std::array<std::uint64_t, kBlock>;  // one word per z, bit y * 8 + x
  /// `dilation` [m]
  void addBlock(const Cell& block, const structures::DistanceField& field, const Pose& X_MW, double dilation);

  double cell_;  ///< [m]
  std::map<std::array<int, 3>, Bits> blocks_;
};

template <typename Visit>
void VoxelSet::visit(Visit&& visit) const {
  for (const auto& [block, bits] : blocks_) {
    const Cell first(block[0] * kBlock, block[1] * kBlock, block[2] * kBlock);
    for (int z = 0; z < kBlock; ++z) {
      for (std::uint64_t word = bits[static_cast<std::size_t>(z)]; word != 0; word &= word - 1) {
        const int bit = std::countr_zero(word);
        visit(Cell(first + Cell(bit % kBlock, bit / kBlock, z)));
      }
    }
  }
}

}  // namespace tenon::bake
