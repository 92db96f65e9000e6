#pragma once

#include <array>
#include <cstdint>

#include "idl/types/spatial.h"
#include "server/structures/feature_shell.h"

namespace tenon::collision {

/// A feature in any frame: a piece of a convex edge, as structures::FeatureEdge, or a point.
struct EdgePiece {
  Vector3 p = Vector3::Zero();     ///< [m] centre
  Vector3 half = Vector3::Zero();  ///< [m] from the centre to one end; zero: a point
  std::array<Vector3, 2> into{Vector3::Zero(), Vector3::Zero()};
  double reach = 0.0;                                                                     ///< [m]
  std::array<double, 2> beyond{0.0, 0.0};                                                 ///< [m]
  std::array<Eigen::Vector2f, 2> skew{Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero()};  ///< [-]

  [[nodiscard]] bool isPoint() const { return half.isZero(0.0); }
};

/// A frame's rotation as matrix: many vectors are turned by it.
struct Transform {
  explicit Transform(const Pose& X) : R(X.matrix()), p(X.translation()) {}
  [[nodiscard]] Vector3 operator*(const Vector3f& p_BP) const { return p + R * p_BP.cast<double>(); }
  [[nodiscard]] Vector3 turned(const Vector3f& v_B) const { return R * v_B.cast<double>(); }
  Matrix3 R;
  Vector3 p;
};

/// A feature in its body's frame.
///
/// Threads: pure. Real-time.
[[nodiscard]] inline EdgePiece pieceOf(const structures::FeatureShell& features, std::uint32_t point) {
  const structures::FeatureEdge& edge = features.edges()[point];
  return {features.points().points()[point].p_MP.cast<double>(),
          edge.half_M.cast<double>(),
          {edge.into_M[0].cast<double>(), edge.into_M[1].cast<double>()},
          edge.reach,
          {edge.beyond[0], edge.beyond[1]},
          edge.skew};
}

/// The same in frame A.
///
/// Threads: pure. Real-time.
[[nodiscard]] inline EdgePiece pieceOf(const structures::FeatureShell& features, std::uint32_t point,
                                       const Transform& X_AB) {
  const structures::FeatureEdge& edge = features.edges()[point];
  return {X_AB * features.points().points()[point].p_MP,
          X_AB.turned(edge.half_M),
          {X_AB.turned(edge.into_M[0]), X_AB.turned(edge.into_M[1])},
          edge.reach,
          {edge.beyond[0], edge.beyond[1]},
          edge.skew};
}

}  // namespace tenon::collision
