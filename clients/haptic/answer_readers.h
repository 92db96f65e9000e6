#pragma once

#include <functional>

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
  /// ones are closed by the next call, once the new ones have heard their server, so that no answer is
  /// missing meanwhile.
  [[nodiscard]] Result<void> choose(bool slow);

 private:
  [[nodiscard]] Result<void> subscribe(bool slow);
  void close(bool slow);

  StationLink& link_;
  Callbacks callbacks_;
  bool slow_ = false;      ///< the newest readers
  bool has_both_ = false;  ///< the former ones are still open
};

}  // namespace tenon::haptic
