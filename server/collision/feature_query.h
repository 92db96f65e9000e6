#pragma once

#include "server/collision/pair_features.h"

namespace tenon::collision {

/// Adds to the result of queryPair the contacts of features up to `query.margin`: of kFeaturePoint, then of
/// kCrossing, after those of shell points. Levels and budget of the query do not apply to features; their
/// points are counted. Where the list is full, feature contacts displace shell points with the largest gaps,
/// at most kFeatureRoom; of the features' points, and of more than kMaxCrossings crossings, those with the
/// smallest gaps are kept (`contacts_dropped`).
///
/// Where more features are near than a list takes, as in a tight fit, their points are reduced by leaf as
/// those of the shell (PairQuery::reduce), have twice the room, and crossings are sought up to a smaller
/// margin.
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

/// A plane that a point may be outside of.
struct ContactSide {
  Vector3 n_W = Vector3::Zero();  ///< [-] as Contact::n_W
  double gap = 0.0;               ///< [m]
};

/// The planes of both faces of the edge of a crossing with a point; none for crossings of two edges. Free
/// space is outside of either.
///
/// Threads: pure. Real-time.
[[nodiscard]] FixedVector<ContactSide, 2> sidesOfWedge(const PairFeatures& features, const Contact& crossing,
                                                       const Pose& X_WA, const Pose& X_WB) noexcept;

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

}  // namespace tenon::collision
