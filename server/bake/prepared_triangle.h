#pragma once

#include <array>

#include "server/structures/triangle.h"

namespace tenon::bake {

/// What of the distance to a triangle does not depend on the point.
struct PreparedTriangle {
  /// [-] A point is skipped whose squared distance to the plane is larger than to the triangle found so far
  /// by this factor, which is more than rounding.
  static constexpr double kPlaneMargin = 1.0 + 1e-6;

  /// [-] Sine of the angle at the first corner, squared, below which rounding turns the normal too far: its
  /// plane may then be farther from a point than the triangle is, and nothing is skipped.
  static constexpr double kThinnest = 1e-8;

  explicit PreparedTriangle(const structures::Triangle& t) {
    const auto store = [](const Vector3& v, std::array<double, 3>& to) { Vector3::Map(to.data()) = v; };
    const Vector3 p_ab = t[1] - t[0];
    const Vector3 p_ac = t[2] - t[0];
    const Vector3 across = p_ab.cross(p_ac);
    store(t[0], a);
    store(t[1], b);
    store(t[2], c);
    store(p_ab, ab);
    store(p_ac, ac);
    store(t[2] - t[1], bc);
    store(across, normal);
    squared_normal = across.squaredNorm();
    has_plane = squared_normal > kThinnest * p_ab.squaredNorm() * p_ac.squaredNorm();
  }

  std::array<double, 3> a, b, c;     ///< [m] corners
  std::array<double, 3> ab, ac, bc;  ///< [m] from corner to corner
  std::array<double, 3> normal;      ///< [m^2] ab x ac
  double squared_normal;             ///< [m^4]
  bool has_plane;                    ///< its normal is that of its plane, see kThinnest
};

}  // namespace tenon::bake
