#pragma once

#include <array>
#include <vector>

#include "tests/support/exact_distance.h"

namespace tenon::test {

/// Solids that may overlap, as one body: its surface is what of theirs lies in no other. The truth about
/// parts as CAD leaves them, by another way than a field's: the sign of each solid, and triangles cut up
/// where they enter another.
///
/// Threads: constant after construction. Real-time: no; a test tool.
class SolidUnion {
 public:
  using Triangle = std::array<Vector3, 3>;
  struct Solid {
    std::vector<Triangle> triangles;  ///< counter-clockwise from outside
    bool closed = true;               ///< an open one has no inside
  };

  explicit SolidUnion(std::vector<Solid> solids);

  [[nodiscard]] bool inside(const Vector3& p_MP) const { return insideAnother(p_MP, solids_.size()); }
  /// Of the surface.
  [[nodiscard]] ExactDistance::Nearest nearest(const Vector3& p_MP) const { return surface_.nearest(p_MP); }
  [[nodiscard]] const std::vector<Triangle>& surface() const { return outer_; }

 private:
  struct Bounded {
    Eigen::AlignedBox3d box;
    bool closed;
    ExactDistance exact;
  };

  [[nodiscard]] bool insideAnother(const Vector3& p_MP, std::size_t but) const;
  void keepOuter(const Triangle& triangle, std::size_t solid);

  std::vector<Bounded> solids_;
  std::vector<Triangle> outer_;
  ExactDistance surface_{{}, {}};
};

}  // namespace tenon::test
