#pragma once

#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon {

/// Numbered points hashed into cubes of one edge, to find those near a point while more are added.
///
/// Neighbours are visited cell by cell in a fixed order and by age in a cell, so what is built with it does
/// not depend on the hash. Threads: one. Real-time: no; used while structures are built.
class PointGrid {
 public:
  explicit PointGrid(double cell) : inverse_cell_(1.0 / cell) {}

  void add(const Vector3& p, std::uint32_t number) { cells_[key(cellOf(p))].push_back({p, number}); }

  /// Calls `visit(number, distance^2)` for every point within one cell edge of p (and some further ones),
  /// until it returns false; false if it did.
  template <typename Visit>
  bool visitNear(const Vector3& p, Visit&& visit) const {
    const Eigen::Vector3i middle = cellOf(p);
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const auto cell = cells_.find(key(middle + Eigen::Vector3i(x, y, z)));
          if (cell == cells_.end()) continue;
          for (const Entry& entry : cell->second) {
            if (!visit(entry.number, (entry.p - p).squaredNorm())) return false;
          }
        }
      }
    }
    return true;
  }

 private:
  struct Entry {
    Vector3 p;
    std::uint32_t number;
  };

  [[nodiscard]] Eigen::Vector3i cellOf(const Vector3& p) const {
    return (p * inverse_cell_).array().floor().matrix().cast<int>();
  }
  [[nodiscard]] static std::uint64_t key(const Eigen::Vector3i& cell) {
    // 21 bits an axis: two cells share a key only when 2 million cells apart, and then distances tell
    const auto bits = [](int c) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(c)) & 0x1FFFFFU;
    };
    return bits(cell.x()) | bits(cell.y()) << 21U | bits(cell.z()) << 42U;
  }

  double inverse_cell_;
  std::unordered_map<std::uint64_t, std::vector<Entry>> cells_;
};

}  // namespace tenon
