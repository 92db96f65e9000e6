#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <map>

#include "idl/types/result.h"
#include "server/structures/distance_field.h"

namespace tenon {

/// The cells of a cubic grid that something has filled: cell (i, j, k) begins at its number times the edge.
///
/// Kept in blocks of 8^3 cells as bits, so memory grows with what is filled. A cell counts when its centre is
/// inside: volumes are right on average, whatever the size of cells. Threads: one.
class VoxelSet {
 public:
  static constexpr int kBlock = 8;
  using Cell = Eigen::Vector3i;

  explicit VoxelSet(double cell) : cell_(cell) {}

  /// Fills the cells whose centre is inside a solid at X_WM, or at most `grow` [m] outside (up to the field's
  /// band). False when there is no more room, or the solid lies too far away.
  [[nodiscard]] bool add(const DistanceField& field, const Pose& X_WM, double grow = 0.0);

  [[nodiscard]] double cell() const { return cell_; }
  [[nodiscard]] std::size_t count() const;
  [[nodiscard]] double volume() const { return static_cast<double>(count()) * cell_ * cell_ * cell_; }
  /// Calls visit(cell) for each filled cell, always in the same order.
  template <typename Visit>
  void visit(Visit&& visit) const;

 private:
  using Bits = std::array<std::uint64_t, kBlock>;  // a word for each z, bit y * 8 + x
  void addBlock(const Cell& block, const DistanceField& field, const Pose& X_MW, double grow);

  double cell_;
  std::map<std::array<int, 3>, Bits> blocks_;
};

template <typename Visit>
void VoxelSet::visit(Visit&& visit) const {
  for (const auto& [place, bits] : blocks_) {
    const Cell first(place[0] * kBlock, place[1] * kBlock, place[2] * kBlock);
    for (int z = 0; z < kBlock; ++z) {
      for (std::uint64_t word = bits[static_cast<std::size_t>(z)]; word != 0; word &= word - 1) {
        const int bit = std::countr_zero(word);
        visit(Cell(first + Cell(bit % kBlock, bit / kBlock, z)));
      }
    }
  }
}

}  // namespace tenon
