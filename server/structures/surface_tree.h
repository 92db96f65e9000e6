#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::structures {

/// A bounding-box hierarchy of a surface's triangles, for the nearest point of the mesh itself. Frame M.
///
/// A distance field takes a fixed time anywhere, but rounds edges off by a fraction of its voxel. This is
/// exact, and its time grows with the number of triangles near the point: a search has a budget of triangles.
///
/// Threads: constant after construction. Real-time: nearest; bounded by its budget.
class SurfaceTree {
 public:
  using Triangle = std::array<Vector3f, 3>;

  struct Nearest {
    /// A triangle is within the radius, and the budget sufficed to complete the search.
    bool found = false;
    double distance = 0.0;           ///< [m] unsigned; only if found
    Vector3 p_MQ = Vector3::Zero();  ///< the nearest point; only if found
  };

  SurfaceTree() = default;
  explicit SurfaceTree(std::vector<Triangle> triangles);

  /// The nearest surface point within `radius` [m]. Every tested triangle is subtracted from `budget`; when
  /// it does not suffice, the budget becomes 0 and nothing is found.
  [[nodiscard]] Nearest nearest(const Vector3& p_MP, double radius, std::uint32_t& budget) const noexcept;

  [[nodiscard]] std::size_t size() const { return triangles_.size(); }

 private:
  struct Node {
    Vector3f low, high;
    std::uint32_t first = 0;  ///< leaf: first triangle; else the second child (the first follows its parent)
    std::uint32_t count = 0;  ///< triangles of a leaf; 0: inner node
  };

  void build(std::uint32_t first, std::uint32_t count);

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace tenon::structures
