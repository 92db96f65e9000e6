#pragma once

#include <algorithm>
#include <cstdint>

#include "server/collision/pair_query.h"
#include "server/collision/query_kernels.h"

namespace tenon::collision {

/// Order of contacts: by gap, then by point index.
struct GapRank {
  double gap;  ///< [m]
  std::uint32_t point;

  bool operator<(const GapRank& other) const {
    return gap != other.gap ? gap < other.gap : point < other.point;
  }
};

/// Contact reduction: decides which near points become the bounded list of a query, before anything else is
/// computed of them. They come in the order of the pointshell and keep it.
///
/// By leaf (reduceLeaves): points are dropped first that have a neighbour of the same leaf with about the
/// same normal and a smaller gap. By gap (keepSmallestGaps): the smallest gaps stay, of equal ones those with
/// the lower point indices.
///
/// Threads: belongs to one query. Real-time: all.
class ContactReducer {
 public:
  /// `lowest` [m] and `highest` [m] bound the gaps that will come.
  ContactReducer(PairQueryResult& result, double lowest, double highest);

  /// Reduces to kMaxPairContacts; the rest is counted as dropped.
  void keepSmallestGaps(NearPoints& near);

  /// Reduces the points from number `first` on, whole leaves, and the earlier ones as far as necessary.
  void reduceLeaves(const LaneFrame& frame, const structures::Pointshell& shell, std::size_t first,
                    NearPoints& near);

 private:
  static constexpr std::size_t kBins = 256;
  /// Reduction by leaf keeps at most this many points, as long as leaves can be reduced further: every
  /// contact is a row of the QP in every SQP step.
  static constexpr std::size_t kReducedSize = 256;

  /// Histogram bin of `gap` [m].
  [[nodiscard]] std::uint16_t binOf(double gap) const {
    const double in_bins = (gap - lowest_) * bins_per_metre_;
    return static_cast<std::uint16_t>(
        static_cast<std::int32_t>(std::clamp(in_bins, 0.0, static_cast<double>(kBins - 1))));
  }
  /// The last rank that stays.
  [[nodiscard]] GapRank lastRank(const NearPoints& near) const;
  /// Reduces the leaves among the first `kept` points to per_leaf_ of each direction; returns the new number.
  std::size_t reduceEarlier(const LaneFrame& frame, const structures::Pointshell& shell, NearPoints& near,
                            std::size_t kept);

  PairQueryResult& result_;
  double lowest_;          ///< [m]
  double bins_per_metre_;  ///< [1/m]
  // state of the reduction by leaf
  /// points kept of each leaf and normal direction
  std::size_t per_leaf_ = structures::Pointshell::kLeafPoints;
  /// index of the first point of each leaf, as long as they can be reduced further
  FixedVector<std::uint32_t, kReducedSize> leaf_starts_;
};

}  // namespace tenon::collision
