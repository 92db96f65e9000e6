#pragma once

#include <array>
#include <vector>

#include "tests/support/exact_distance.h"

namespace tenon::test {

/// Exact union of solids that may overlap, as reference for parts as CAD exports them. Its surface is that of
/// the solids outside all others. Computed independently of a distance field: from the sign of each solid,
/// and from triangles that are subdivided where they enter another solid.
///
/// Threads: constant after construction. Real-time: no; a test tool.
class SolidUnion {
 public:
  using Triangle = std::array<Vector3, 3>;
  struct Solid {
    std::vector<Triangle> triangles;  ///< counter-clockwise from outside
    bool closed = true;               ///< an open surface has no inside
  };

  explicit SolidUnion(std::vector<Solid> solids);

  [[nodiscard]] bool inside(const Vector3& p_MP) const { return insideAnother(p_MP, solids_.size()); }
  /// Nearest point of the union's surface.
  [[nodiscard]] ExactDistance::Nearest nearest(const Vector3& p_MP) const { return surface_.nearest(p_MP); }
  [[nodiscard]] const std::vector<Triangle>& surface() const { return outer_; }

 private:
  struct Bounded {
    Eigen::AlignedBox3d box;
    bool closed;
    ExactDistance exact;
  };

  /// Whether P is inside a solid other than number `excluded`.
  [[nodiscard]] bool insideAnother(const Vector3& p_MP, std::size_t excluded) const;
  /// Adds the pieces of a triangle of solid number `solid` that are outside all others.
  void addOuterPieces(const Triangle& triangle, std::size_t solid);

  std::vector<Bounded> solids_;
  std::vector<Triangle> outer_;
  ExactDistance surface_{{}, {}};
};

}  // namespace tenon::test
