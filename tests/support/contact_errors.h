#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/collision/pair_query.h"
#include "tests/support/solid_union.h"

namespace tenon::test {

/// What queries say of a shell A in a body B against what is true of B, over poses in contact.
///
/// Threads: one at a time. Real-time: no; a test tool.
class ContactErrors {
 public:
  /// `result` is the answer to `query`, refined or not, without dilation and with the sum. Points that
  /// the list has no room for have no depth; whether they are missed the field tells.
  void add(const PairQuery& query, const PairQueryResult& result, const SolidUnion& truth_B);

  /// Points that are inside in truth, and the share of them that the query has outside.
  [[nodiscard]] std::size_t touching() const { return touching_; }
  [[nodiscard]] double missed() const;
  /// Quantile of the error of depth [m], of listed points inside.
  [[nodiscard]] double depth(double share) const { return at(depth_, share); }
  /// Quantile over poses of the error of the net force, as a share of the force.
  [[nodiscard]] double force(double share) const { return at(force_, share); }
  [[nodiscard]] std::size_t poses() const { return force_.size(); }

  [[nodiscard]] std::string text() const;

 private:
  static double at(std::vector<double> values, double share);

  std::vector<double> depth_, force_;
  std::size_t touching_ = 0;
  std::size_t missed_ = 0;
};

}  // namespace tenon::test
