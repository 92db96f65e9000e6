#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "server/collision/pair_query.h"

namespace tenon {

/// Points of one leaf, as thinning looks at them.
struct LeafContacts {
  static constexpr std::size_t kMost = Pointshell::kLeafPoints;

  std::array<double, kMost> gap;
  std::array<Vector3, kMost> direction;  ///< of the push, of any length
  std::size_t count = 0;
};

/// How contacts are ranked: by gap, then by name.
struct GapRank {
  double gap;
  std::uint32_t point;

  bool operator<(const GapRank& other) const {
    return gap != other.gap ? gap < other.gap : point < other.point;
  }
};

/// Contacts that come together, in the order of the shell.
struct IncomingContacts {
  static constexpr std::size_t kMost = 2048;

  std::array<double, kMost> gap;
  std::array<std::uint32_t, kMost> point;
  std::array<std::uint32_t, kMost> number;  ///< the caller's own
  std::size_t count = 0;

  void push_back(double the_gap, std::uint32_t the_point, std::uint32_t the_number) {
    gap[count] = the_gap;
    point[count] = the_point;
    number[count++] = the_number;
  }
};

/// Decides which contacts have room in the list of a query, as they come in the order of the shell.
///
/// Without thinning those with the smallest gaps stay, of equal ones those with the lower names: which they
/// are is known before any of those that come together is written. With thinning, points give way first that
/// stand behind a neighbour.
///
/// Threads: one query's. Real-time: all.
class ContactSink {
 public:
  /// Gaps lie between `lowest` and `highest` [m].
  ContactSink(PairQueryResult& result, double lowest, double highest);

  [[nodiscard]] bool hasRoom(std::size_t count) const {
    return result_.contacts.size() + count <= kMaxPairContacts;
  }
  /// Of more than there is room for: takes from the list what has to go for them, and returns the last of
  /// all that stay. Those that come and are not behind it are listed next.
  GapRank makeRoom(const IncomingContacts& coming);

  /// Which of a leaf's points may be listed, a bit each, made room for if that is possible. They are listed
  /// next.
  std::uint32_t thinned(const LeafContacts& leaf);

 private:
  static constexpr std::size_t kSteps = 256;
  /// A list that may be thinned is kept this short while there is anything to thin: every row of it costs in
  /// every sub-step.
  static constexpr std::size_t kThinnedTo = 256;

  [[nodiscard]] std::uint16_t stepOf(double gap) const {
    const double in_steps = (gap - lowest_) * steps_a_metre_;
    return static_cast<std::uint16_t>(
        static_cast<std::int32_t>(std::clamp(in_steps, 0.0, static_cast<double>(kSteps - 1))));
  }
  void thinList();

  PairQueryResult& result_;
  double lowest_;
  double steps_a_metre_;
  // of leaves that were thinned
  std::size_t per_leaf_ = Pointshell::kLeafPoints;           ///< and direction
  std::array<std::uint32_t, kMaxPairContacts> leaf_starts_;  ///< where the listed leaves begin
  std::size_t leaf_count_ = 0;
};

}  // namespace tenon
