#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "server/collision/pair_query.h"

namespace tenon {

/// Points of one leaf, as thinning looks at them.
struct LeafContacts {
  static constexpr std::size_t kMost = Pointshell::kLeafPoints;

  std::array<double, kMost> gap;
  std::array<Vector3, kMost> direction;  ///< of the push, of any length
  std::size_t count = 0;
};

/// Decides which contacts have room in the list of a query, as they come in the order of the shell.
///
/// Without thinning those with the smallest gaps stay, of equal ones those with the lower names. What comes
/// is announced first and counted in equal steps of gaps; the step up to which there is room only ever falls,
/// so most of what has to go is never listed. With thinning, points give way first that stand behind a
/// neighbour.
///
/// Threads: one query's. Real-time: all.
class ContactSink {
 public:
  /// Gaps lie between `lowest` and `highest` [m].
  ContactSink(PairQueryResult& result, double lowest, double highest);

  /// Whether there is no room for so many more: they are to be announced before they are listed.
  bool overflows(std::size_t count);
  void announce(double gap) {
    const std::size_t step = stepOf(gap);
    if (step > last_step_) return;
    ++histogram_[step];
    ++counted_;
  }
  /// All of them are.
  void closeAnnouncement() {
    while (counted_ - histogram_[last_step_] >= kMaxPairContacts) counted_ -= histogram_[last_step_--];
    constexpr double kEver = std::numeric_limits<double>::infinity();
    last_begin_ = last_step_ == 0 ? -kEver : static_cast<double>(last_step_);
    last_end_ = last_step_ + 1 == kSteps ? kEver : static_cast<double>(last_step_ + 1);
  }
  /// Whether a contact of that gap has to be listed; those that have not are counted as dropped.
  bool wants(double gap) {
    if (!overflow_ || inSteps(gap) < last_end_) return true;
    ++result_.counts.contacts_dropped;
    return false;
  }
  /// Where the next contact that is wanted goes; the place keeps what was there.
  Contact& next() {
    if (Contact* place = result_.contacts.extend()) return *place;
    if (Contact* place = overflow_->extend()) return *place;
    selectDeepest();
    Contact* place = result_.contacts.extend();
    return place != nullptr ? *place : *overflow_->extend();
  }
  /// After the last: the list is what it shall be.
  void selectDeepest();

  /// Which of a leaf's points may be listed, a bit each, made room for if that is possible. They are listed
  /// next.
  std::uint32_t thinned(const LeafContacts& leaf);

 private:
  static constexpr std::size_t kSteps = 512;
  /// A list that may be thinned is kept this short while there is anything to thin: every row of it costs in
  /// every sub-step.
  static constexpr std::size_t kThinnedTo = 256;

  [[nodiscard]] double inSteps(double gap) const { return (gap - lowest_) * steps_a_metre_; }
  [[nodiscard]] std::size_t stepOf(double gap) const {
    return static_cast<std::size_t>(std::clamp(inSteps(gap), 0.0, static_cast<double>(kSteps - 1)));
  }
  void thinList();

  PairQueryResult& result_;
  double lowest_;
  double steps_a_metre_;
  // of what is listed and what is announced
  std::array<std::uint32_t, kSteps> histogram_;
  std::size_t last_step_ = kSteps - 1;        ///< what lies beyond has no room
  double last_begin_ = 0.0, last_end_ = 0.0;  ///< [steps]
  std::size_t counted_ = 0;                   ///< up to that step
  std::optional<FixedVector<Contact, 256>> overflow_;
  // of leaves that were thinned
  std::size_t per_leaf_ = Pointshell::kLeafPoints;           ///< and direction
  std::array<std::uint32_t, kMaxPairContacts> leaf_starts_;  ///< where the listed leaves begin
  std::size_t leaf_count_ = 0;
};

}  // namespace tenon
