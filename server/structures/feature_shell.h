#pragma once

#include <array>
#include <memory>
#include <span>
#include <utility>

#include "server/structures/pointshell.h"

namespace tenon::structures {

/// The piece of a convex edge about a feature point, in the mesh frame M.
struct FeatureEdge {
  /// [m] from the point to one end of the piece; the other end is opposite. Zero: the point is on no edge.
  Vector3f half_M = Vector3f::Zero();
  /// Unit vectors in the two faces of the edge, perpendicular to it and away from it. A direction n with
  /// n . into <= 0 for both separates: the object is on one side of a plane through the edge.
  std::array<Vector3f, 2> into_M{Vector3f::Zero(), Vector3f::Zero()};
  /// [m] Nearer to the piece than this, and between its ends, the surface is the two faces alone.
  float reach = 0.0F;
  /// [m] Length of the edge beyond the ends of the piece at -half and +half, up to a corner.
  std::array<float, 2> beyond{0.0F, 0.0F};
  /// [-] The planes in which the piece ends at -half and +half: a point at r from the edge is at the end of
  /// the piece where it is skew . (into_M[0] . r, into_M[1] . r) before the end of the edge. Zero: the plane
  /// is perpendicular to the edge.
  std::array<Eigen::Vector2f, 2> skew{Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero()};
};

/// The sharp features of an object's surface: corners, pieces of convex edges, tips of pins.
///
/// An even pointshell misses what is thinner than its spacing on the other object. So a pair also asks for
/// the features of the SDF side in the field of the pointshell side, and for crossings of features of both
/// (server/collision/feature_query.h). Features are few, and in one level: a query never skips them.
///
/// A non-owning view with a shared owner, as Pointshell. Threads: constant after construction. Real-time: all
/// but the constructor.
class FeatureShell {
 public:
  FeatureShell() = default;
  /// `edges` has an entry for each point; `owner` keeps its memory alive.
  FeatureShell(Pointshell points, std::span<const FeatureEdge> edges, std::shared_ptr<const void> owner)
      : points_(std::move(points)), edges_(edges), owner_(std::move(owner)) {
    for (const FeatureEdge& edge : edges_) {
      const double half = edge.half_M.cast<double>().norm();
      if (half > longest_half_) longest_half_ = half;
    }
  }

  [[nodiscard]] const Pointshell& points() const { return points_; }
  [[nodiscard]] std::span<const FeatureEdge> edges() const { return edges_; }
  [[nodiscard]] bool empty() const { return points_.empty(); }
  /// [m] Largest distance of a point of a piece from its centre.
  [[nodiscard]] double longestHalf() const { return longest_half_; }

 private:
  Pointshell points_;
  std::span<const FeatureEdge> edges_;
  std::shared_ptr<const void> owner_;
  double longest_half_ = 0.0;  ///< [m]
};

}  // namespace tenon::structures
