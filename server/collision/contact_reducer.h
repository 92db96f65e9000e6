#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "server/collision/pair_query.h"

namespace tenon::collision {

/// Contacts of one leaf, as the reduction reads them.
struct LeafContacts {
  static constexpr std::size_t kCapacity = structures::Pointshell::kLeafPoints;

  std::array<double, kCapacity> gap;         ///< [m]
  std::array<Vector3, kCapacity> direction;  ///< of the normal, of any length
  std::size_t count = 0;
};

/// Order of contacts: by gap, then by point index.
struct GapRank {
  double gap;  ///< [m]
  std::uint32_t point;

  bool operator<(const GapRank& other) const {
    return gap != other.gap ? gap < other.gap : point < other.point;
  }
};

/// A batch of contacts to be listed, in the order of the pointshell.
struct IncomingContacts {
  static constexpr std::size_t kCapacity = 2048;

  std::array<double, kCapacity> gap;  ///< [m]
  std::array<std::uint32_t, kCapacity> point;
  std::array<std::uint32_t, kCapacity> tag;  ///< the caller's own identification
  std::size_t count = 0;

  /// `the_gap` [m]. There must be capacity left.
  void push_back(double the_gap, std::uint32_t the_point, std::uint32_t the_tag) {
    gap[count] = the_gap;
    point[count] = the_point;
    tag[count++] = the_tag;
  }
};

/// Contact reduction: decides which contacts stay in the bounded list of a query. Contacts come in the order
/// of the pointshell, batch by batch.
///
/// By gap (evictFor): the smallest gaps stay, of equal ones those with the lower point indices. The decision
/// is made before any contact of the batch is written. By leaf (reduceLeaf): contacts are dropped first that
/// have a neighbour of the same leaf with about the same normal and a smaller gap.
///
/// Threads: belongs to one query. Real-time: all.
class ContactReducer {
 public:
  /// `lowest` [m] and `highest` [m] bound the gaps that will come.
  ContactReducer(PairQueryResult& result, double lowest, double highest);

  [[nodiscard]] bool fits(std::size_t count) const {
    return result_.contacts.size() + count <= kMaxPairContacts;
  }
  /// For a batch that does not fit: removes listed contacts with larger ranks than those that stay, and
  /// returns the last rank that stays. The caller then lists the contacts of the batch up to that rank.
  GapRank evictFor(const IncomingContacts& batch);

  /// Bit mask of the leaf's contacts to be listed; frees capacity for them by reducing earlier leaves, if
  /// possible. The caller lists them next.
  std::uint32_t reduceLeaf(const LeafContacts& leaf);

 private:
  static constexpr std::size_t kBins = 256;
  /// Reduction by leaf keeps the list to at most this many contacts, as long as leaves can be reduced
  /// further: every contact is a row of the QP in every SQP step.
  static constexpr std::size_t kReducedSize = 256;

  /// Histogram bin of `gap` [m].
  [[nodiscard]] std::uint16_t binOf(double gap) const {
    const double in_bins = (gap - lowest_) * bins_per_metre_;
    return static_cast<std::uint16_t>(
        static_cast<std::int32_t>(std::clamp(in_bins, 0.0, static_cast<double>(kBins - 1))));
  }
  void reduceList();

  PairQueryResult& result_;
  double lowest_;          ///< [m]
  double bins_per_metre_;  ///< [1/m]
  // state of the reduction by leaf
  /// contacts kept of each leaf and normal direction
  std::size_t per_leaf_ = structures::Pointshell::kLeafPoints;
  std::array<std::uint32_t, kMaxPairContacts> leaf_starts_;  ///< index of the first contact of each leaf
  std::size_t leaf_count_ = 0;
};

}  // namespace tenon::collision
