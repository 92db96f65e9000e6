#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::test {

/// The truth about a mesh: the nearest point of any triangle, through a tree of boxes. Unsigned.
///
/// Threads: constant after construction. Real-time: no; a test tool.
class ExactDistance {
 public:
  struct Nearest {
    double distance = 0.0;
    Vector3 p_MQ = Vector3::Zero();  ///< the nearest point of the surface
    std::uint32_t triangle = 0;
  };

  ExactDistance(std::span<const Vector3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles);

  [[nodiscard]] Nearest nearest(const Vector3& p_MP) const;

  /// Whether p is inside a closed mesh: the sign of its solid angle, summed over all triangles (slow, certain
  /// for consistent winding).
  [[nodiscard]] bool inside(const Vector3& p_MP) const;

  /// The same, fast, for a closed mesh of consistent winding without overlaps: by the normals of all
  /// triangles at the nearest point, weighted with their angles there (Baerentzen and Aanaes 2005).
  [[nodiscard]] bool behindNearest(const Vector3& p_MP) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    std::uint32_t first = 0;
    std::uint32_t count = 0;  // 0: children follow at `left` and `right`
    std::uint32_t left = 0;
    std::uint32_t right = 0;
  };

  std::uint32_t build(std::uint32_t first, std::uint32_t count);
  void search(std::uint32_t node, const Vector3& p, Nearest& best, double& squared) const;
  /// Adds the weighted normals of the triangles that touch q.
  void sumNormals(std::uint32_t node, const Vector3& q, Vector3& sum) const;

  std::vector<std::array<Vector3, 3>> triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace tenon::test
