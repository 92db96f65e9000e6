#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "server/collision/pair_query.h"
#include "server/structures/feature_shell.h"

namespace tenon::collision {

/// The second direction of a pair: the features of both bodies, and the field of A.
///
/// The points of A's pointshell miss what is thinner than their spacing on B: a stud, an edge, a corner. So
/// B's features are also asked in A's field, with contacts as of A against B (normals from B into A). Two
/// edges that cross touch between the points of both: the gap there is that of the closest points of their
/// segments, the fields only find candidates. Features are where the exact surface is: thin walls of B are
/// thickened for A's points alone.
struct PairFeatures {
  const structures::FeatureShell* features_A = nullptr;
  const structures::FeatureShell* features_B = nullptr;
  const structures::DistanceField* field_A = nullptr;
  /// [m] Of the dilation of A's field so much counts for features of B
  double most_dilation_A = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool any() const {
    return features_B != nullptr && !features_B->empty() && !field_A->empty();
  }
};

/// Whether there is a feature of this index, and a piece of an edge about it.
[[nodiscard]] inline bool isEdge(const structures::FeatureShell& features, std::size_t point) {
  return point < features.edges().size() && features.edges()[point].half_M.squaredNorm() > 0.0F;
}

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

/// B's features near A, in A's frame.
struct NearPieces {
  struct Ball {
    Vector3f p_A;
    float reach = 0.0F;  ///< [m] centres of features that meet this one are no farther
    std::uint32_t piece = 0;
  };
  using Balls = std::array<Ball, kMaxPairContacts>;

  std::uint32_t count = 0;
  std::array<EdgePiece, kMaxPairContacts> pieces;
  std::array<std::uint32_t, kMaxPairContacts> point;  ///< index in B's features
  Balls all, by_cluster, by_leaf;
};

/// Memory of the functions below; one for each thread.
struct FeatureScratch {
  PairQueryResult of_B;   ///< B's features in A's field
  ContactList crossings;  ///< found, before the nearest are kept
  NearPieces near;
};

/// Adds to the result of queryPair the contacts of features up to `query.margin`: of kFeaturePoint, then of
/// kCrossing, after those of shell points. Levels and budget of the query do not apply to features; their
/// points are counted. Where the list is full, feature contacts displace shell points with the largest gaps,
/// at most kFeatureRoom; of the features' points, and of more than kMaxCrossings crossings, those with the
/// smallest gaps are kept (`contacts_dropped`).
///
/// A crossing is of two edges, or of a point of one body beside an edge of the other. There the solid is the
/// wedge between two planes, and the gap is exact, while the interpolated field rounds the edge off.
///
/// A crossing is listed when it may come about within `query.margin` of motion. While it is beyond the ends
/// of its pieces, or the faces beside it are nearer, or a point is beyond the reach of the edge, it is
/// dormant: its gap is kDormantGap plus the distance of its segments, which counts in
/// PairQueryResult::dormant_gap. In the solver it is a constraint that is never active: at most kMaxCrossings
/// rows of a pair.
///
/// Threads: pure, but for the scratch. Real-time.
void queryFeatures(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                   PairQueryResult& result) noexcept;

/// resampleContacts() for a list with contacts of features, in the order of queryFeatures(); `displacement`
/// [m] as there.
///
/// Threads: pure. Real-time.
void resampleFeatures(const PairQuery& query, const PairFeatures& features, double displacement,
                      PairQueryResult& result) noexcept;

/// [m] Lower bound of the gap of features and crossings up to `query.margin`, beyond that a larger one. Lists
/// nothing; adds its work to `counts`.
///
/// Threads: pure, but for the scratch. Real-time.
[[nodiscard]] double featureGap(const PairQuery& query, const PairFeatures& features, FeatureScratch& scratch,
                                QueryCounts& counts) noexcept;

inline constexpr std::size_t kFeatureRoom = 128;
inline constexpr std::size_t kMaxCrossings = 64;

}  // namespace tenon::collision
