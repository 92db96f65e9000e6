#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::test {

/// Exact unsigned distance to a mesh, as reference for tests: nearest point of any triangle, by a tree of
/// bounding boxes. Frame M.
///
/// Threads: constant after construction. Real-time: no; a test tool.
class ExactDistance {
 public:
  struct Nearest {
    double distance = 0.0;           ///< [m] unsigned
    Vector3 p_MQ = Vector3::Zero();  ///< the nearest point of the surface
    std::uint32_t triangle = 0;
  };

  ExactDistance(std::span<const Vector3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles);

  /// Nearest point of the mesh; a mesh without triangles gives distance 0 at the origin.
  [[nodiscard]] Nearest nearest(const Vector3& p_MP) const;

  /// Whether P is inside a closed mesh, by the sum of the solid angles of all triangles: slow, and reliable
  /// for consistent orientation.
  [[nodiscard]] bool inside(const Vector3& p_MP) const;

  /// Likewise, fast, for a closed mesh of consistent orientation without overlaps: by the angle-weighted
  /// pseudonormal at the nearest point (Baerentzen and Aanaes 2005).
  [[nodiscard]] bool behindNearest(const Vector3& p_MP) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    std::uint32_t first = 0;
    std::uint32_t count = 0;  // of triangles; 0: an inner node with children `left` and `right`
    std::uint32_t left = 0;
    std::uint32_t right = 0;
  };

  std::uint32_t build(std::uint32_t first, std::uint32_t count);
  /// `squared` [m^2]: squared distance of `best`.
  void search(std::uint32_t node, const Vector3& p, Nearest& best, double& squared) const;
  /// Adds the angle-weighted normals of the triangles that touch Q.
  void sumNormals(std::uint32_t node, const Vector3& q, Vector3& sum) const;

  std::vector<std::array<Vector3, 3>> triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace tenon::test
