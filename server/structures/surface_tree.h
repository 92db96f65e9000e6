#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon {

/// The triangles of a surface in a tree of boxes: where is the nearest point of the mesh itself? Frame M.
///
/// A distance field answers anywhere in a fixed time, but rounds edges off by a part of its voxel; this is
/// exact and takes as long as there are triangles about, so a search has a budget of them.
///
/// Threads: constant after construction. Real-time: nearest; bounded by its budget.
class SurfaceTree {
 public:
  using Triangle = std::array<Vector3f, 3>;

  struct Nearest {
    bool found = false;     ///< there is one within the radius, and the budget sufficed to know it is nearest
    double distance = 0.0;  ///< [m] unsigned
    Vector3 p_MQ = Vector3::Zero();
  };

  SurfaceTree() = default;
  explicit SurfaceTree(std::vector<Triangle> triangles);

  /// The nearest point within `radius` [m]. Every triangle that is looked at is taken from `budget`.
  [[nodiscard]] Nearest nearest(const Vector3& p_MP, double radius, std::uint32_t& budget) const noexcept;

  [[nodiscard]] std::size_t size() const { return triangles_.size(); }

 private:
  struct Node {
    Vector3f low, high;
    std::uint32_t first = 0;  ///< triangle of a leaf, or the second child; the first one follows its parent
    std::uint32_t count = 0;  ///< triangles of a leaf; 0: has children
  };

  void build(std::uint32_t first, std::uint32_t count);

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace tenon
