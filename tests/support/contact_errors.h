#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/collision/pair_query.h"
#include "tests/support/solid_union.h"

namespace tenon::test {

/// Errors of query results of a pointshell A in a body B with respect to exact distances of B, over poses in
/// contact. Depths are those in B's dilated surface.
///
/// Threads: one quantileOf a time. Real-time: no; a test tool.
class ContactErrors {
 public:
  /// `listed_to` [m]: contacts with a gap of at most this count for depth().
  explicit ContactErrors(double listed_to = 0.0) : listed_to_(listed_to) {}

  /// Adds the result of `query`, refined or not. The query sums penalties. Points that are not listed count
  /// for missed(), by the sign of their gap in the field, but not for depth(). Contacts of features do not
  /// count.
  void add(const collision::PairQuery& query, const collision::PairQueryResult& result,
           const SolidUnion& truth_B);

  /// Number of points inside the exact, dilated solids, over all poses.
  [[nodiscard]] std::size_t pointsInside() const { return points_inside_; }
  /// [-] Fraction of them that the query reports as outside.
  [[nodiscard]] double missed() const;
  /// [m] Quantile of the error of listed gaps; `quantile` [-] 0 to 1.
  [[nodiscard]] double depth(double quantile) const { return quantileOf(depth_, quantile); }
  /// [-] Quantile over poses of the net force error relative to the exact net force; `quantile` [-] 0 to 1.
  [[nodiscard]] double force(double quantile) const { return quantileOf(force_, quantile); }
  [[nodiscard]] std::size_t poses() const { return force_.size(); }

  /// Summary in one line.
  [[nodiscard]] std::string text() const;

 private:
  /// `quantile` [-] 0 to 1.
  static double quantileOf(std::vector<double> values, double quantile);

  double listed_to_;           ///< [m]
  std::vector<double> depth_;  ///< [m] absolute errors
  std::vector<double> force_;  ///< [-] relative errors
  std::size_t points_inside_ = 0;
  std::size_t missed_ = 0;
};

}  // namespace tenon::test
