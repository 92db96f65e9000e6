#pragma once

#include <array>
#include <cmath>

#include "idl/types/spatial.h"

namespace tenon::structures {

/// Three corners in frame M [m]. Its winding has no meaning.
using Triangle = std::array<Vector3, 3>;

/// Squared distance [m^2] from p to the nearest point of a triangle (Ericson, Real-Time Collision Detection,
/// 5.1.5). A triangle without area counts as a segment or a point.
[[nodiscard]] inline double squaredDistance(const Vector3& p, const Triangle& t) {
  const Vector3 ab = t[1] - t[0];
  const Vector3 ac = t[2] - t[0];
  const Vector3 ap = p - t[0];
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return ap.squaredNorm();
  const Vector3 bp = p - t[1];
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return bp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    const double along = d1 > d3 ? d1 / (d1 - d3) : 0.0;
    return (ap - along * ab).squaredNorm();
  }
  const Vector3 cp = p - t[2];
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return cp.squaredNorm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    const double along = d2 > d6 ? d2 / (d2 - d6) : 0.0;
    return (ap - along * ac).squaredNorm();
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double length = (d4 - d3) + (d5 - d6);
    const double along = length > 0.0 ? (d4 - d3) / length : 0.0;
    return (bp - along * (t[2] - t[1])).squaredNorm();
  }
  const Vector3 normal = ab.cross(ac);
  const double above = normal.dot(ap);
  return above * above / normal.squaredNorm();
}

/// Whether the ray from p along `direction` (of any length) intersects a triangle (Moeller and Trumbore
/// 1997). A ray in its plane does not.
[[nodiscard]] inline bool rayIntersects(const Vector3& p, const Vector3& direction, const Triangle& t) {
  const Vector3 ab = t[1] - t[0];
  const Vector3 ac = t[2] - t[0];
  const Vector3 across = direction.cross(ac);
  const double volume = ab.dot(across);
  if (volume == 0.0) return false;
  const Vector3 ap = p - t[0];
  const double u = ap.dot(across) / volume;
  const Vector3 turned = ap.cross(ab);
  const double v = direction.dot(turned) / volume;
  return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ac.dot(turned) / volume > 0.0;
}

[[nodiscard]] inline Eigen::AlignedBox3d boxOf(const Triangle& t) {
  Eigen::AlignedBox3d box(t[0]);
  box.extend(t[1]);
  box.extend(t[2]);
  return box;
}

/// [m^2]
[[nodiscard]] inline double areaOf(const Triangle& t) { return (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2; }

/// [m] The length of the longest edge; `from` becomes the number of the corner where it begins.
[[nodiscard]] inline double longestEdge(const Triangle& t, std::size_t& from) {
  double squared = -1.0;
  for (std::size_t edge = 0; edge < 3; ++edge) {
    const double length = (t[(edge + 1) % 3] - t[edge]).squaredNorm();
    if (length <= squared) continue;
    squared = length;
    from = edge;
  }
  return std::sqrt(squared);
}

/// Both halves of a triangle, split at the middle of the edge from corner `from` to the next; the first one
/// has that corner.
[[nodiscard]] inline std::array<Triangle, 2> bisected(const Triangle& t, std::size_t from) {
  const std::size_t to = (from + 1) % 3;
  std::array<Triangle, 2> halves{t, t};
  halves[0][to] = halves[1][from] = (t[from] + t[to]) / 2;
  return halves;
}

}  // namespace tenon::structures
