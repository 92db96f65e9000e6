#pragma once

#include <algorithm>
#include <functional>
#include <vector>

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
  /// ones are closed by a call after the new ones have heard frames and a manifold of each hand, so that no
  /// answer is missing meanwhile; and after kMostCalls in any case, since an absent hand has no manifolds.
  [[nodiscard]] Result<void> choose(bool slow);

  /// No others read: what has come since the last call of choose() was slow.
  [[nodiscard]] bool hasSlowAlone() const { return slow_ && !has_both_; }

  static constexpr int kMostCalls = 10;

 private:
  [[nodiscard]] Result<void> subscribe(bool slow);
  /// The newest readers have heard all that they read.
  [[nodiscard]] bool newestHear() const {
    return std::find(heard_.begin(), heard_.end(), false) == heard_.end();
  }
  void close(bool slow);

  StationLink& link_;
  Callbacks callbacks_;
  bool slow_ = false;        ///< the newest readers
  bool has_both_ = false;    ///< the former ones are still open
  int calls_ = 0;            ///< of choose() since then
  std::vector<bool> heard_;  ///< by the newest readers: a frame, then a manifold of each hand
};

}  // namespace tenon::haptic
