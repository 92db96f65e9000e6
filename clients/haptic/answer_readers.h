#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "clients/haptic/answer_loss.h"
#include "clients/haptic/station_link.h"

namespace tenon::haptic {

/// A station's readers of what its server answers: frames, and the manifolds of its hands. Of each tick, or
/// slow ones: 100 frames and 50 manifolds a second.
///
/// Threads: one (wire). Real-time: no.
class AnswerReaders {
 public:
  struct Callbacks {
    std::function<void(const WorldFrame&)> frame;
    std::function<void(const HandManifold&)> manifold;
  };

  /// `link` must outlive this.
  AnswerReaders(StationLink& link, Callbacks callbacks) : link_(link), callbacks_(std::move(callbacks)) {}

  /// Those of each tick.
  [[nodiscard]] Result<void> open() { return subscribe(false); }
  /// Changes to those that are wanted; called about once a second. The new readers come first: the former
  /// ones are closed by a call after the new ones have heard frames and a manifold of each hand of which the
  /// former ones still hear, so that no answer is missing meanwhile; an absent hand has none. After
  /// kMostCalls they are closed in any case.
  [[nodiscard]] Result<void> choose(bool slow);

  /// No others read: what has come since the last call of choose() was slow.
  [[nodiscard]] bool hasSlowAlone() const { return slow_ && !has_both_; }

  /// [-] AnswerLoss of the manifolds since the last call, of the newest readers if it is known.
  [[nodiscard]] std::optional<double> takeLoss();

  static constexpr int kMostCalls = 10;

 private:
  struct Heard {
    bool by_newest = false, by_former = false;
  };
  [[nodiscard]] Result<void> subscribe(bool slow);
  /// Answer `index` of heard_ came to a reader of slow ones or of those of each tick.
  void hear(std::size_t index, bool slow) {
    (slow == slow_ ? heard_[index].by_newest : heard_[index].by_former) = true;
  }
  /// The newest readers have heard frames, and what the former ones have heard meanwhile.
  [[nodiscard]] bool newestHear() const {
    return heard_[0].by_newest && std::none_of(heard_.begin(), heard_.end(), [](const Heard& one) {
             return one.by_former && !one.by_newest;
           });
  }
  void close(bool slow);

  StationLink& link_;
  AnswerLoss slow_loss_, loss_;  ///< of slow manifolds, and of those of each tick
  Callbacks callbacks_;
  bool slow_ = false;         ///< the newest readers
  bool has_both_ = false;     ///< the former ones are still open
  int calls_ = 0;             ///< of choose() since then
  std::vector<Heard> heard_;  ///< since then: a frame, then a manifold of each hand
};

}  // namespace tenon::haptic
