#pragma once

#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::structures {

/// A spatial hash of numbered points: finds those near a point while more are added.
///
/// Neighbours are visited cell by cell in a fixed order and within a cell in the order they were added, so
/// results do not depend on the hash function.
///
/// Threads: one. Real-time: no; used while structures are built.
class PointGrid {
 public:
  /// Cubic cells with edge `cell` [m] > 0.
  explicit PointGrid(double cell) : inverse_cell_(1.0 / cell) {}

  void add(const Vector3& p, std::uint32_t number) { cells_[key(cellOf(p))].push_back({p, number}); }

  /// Calls `visit(number, squared distance)` for every point within one cell edge of p (and some further
  /// ones) until it returns false. Returns false in that case.
  template <typename Visit>
  bool visitNear(const Vector3& p, Visit&& visit) const {
    const Eigen::Vector3i middle = cellOf(p);
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const auto cell = cells_.find(key(middle + Eigen::Vector3i(x, y, z)));
          if (cell == cells_.end()) continue;
          for (const NumberedPoint& entry : cell->second) {
            if (!visit(entry.number, (entry.p - p).squaredNorm())) return false;
          }
        }
      }
    }
    return true;
  }

 private:
  struct NumberedPoint {
    Vector3 p;
    std::uint32_t number;
  };

  [[nodiscard]] Eigen::Vector3i cellOf(const Vector3& p) const {
    return (p * inverse_cell_).array().floor().matrix().cast<int>();
  }
  [[nodiscard]] static std::uint64_t key(const Eigen::Vector3i& cell) {
    // 21 bits per axis: two cells share a key only when 2 million cells apart, and then the distance excludes
    // their points
    const auto bits = [](int c) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(c)) & 0x1FFFFFU;
    };
    return bits(cell.x()) | bits(cell.y()) << 21U | bits(cell.z()) << 42U;
  }

  double inverse_cell_;  ///< [1/m]
  std::unordered_map<std::uint64_t, std::vector<NumberedPoint>> cells_;
};

}  // namespace tenon::structures
