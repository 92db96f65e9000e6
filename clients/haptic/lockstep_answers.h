#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>

#include "idl/types/messages/contacts.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/steps.h"

namespace tenon::haptic {

/// Which answers of a tick a station in lockstep has: it steps when they are complete.
///
/// Threads: one. Real-time: no.
class LockstepAnswers {
 public:
  void received(const WorldFrame& frame) {
    if (frame.tick > tick_) {
      tick_ = frame.tick;
      parts_ = 0;
    }
    if (frame.tick == tick_) parts_ |= std::uint64_t{1} << frame.part;
    parts_expected_ = frame.parts;
    frame_revision_ = frame.step_revision;
  }
  void received(const HandManifold& manifold) { manifolds_[manifold.hand] = manifold.tick; }
  void received(const StepState& step) { step_revision_ = step.revision; }

  /// All frames of `tick`, the manifolds of `hands`, and the step that the frames name.
  [[nodiscard]] bool complete(Tick tick, std::span<const HandId> hands) const {
    if (tick_ != tick || parts_expected_ == 0) return false;
    if (parts_ != (std::uint64_t{1} << parts_expected_) - 1) return false;
    if (step_revision_ < frame_revision_) return false;
    return std::all_of(hands.begin(), hands.end(), [&](HandId hand) {
      const auto received = manifolds_.find(hand);
      return received != manifolds_.end() && received->second == tick;
    });
  }
  /// Forgets those of the former life of a server, whose ticks a resumed one computes again.
  void reset() {
    tick_ = 0;
    parts_ = 0;
    parts_expected_ = 0;
    manifolds_.clear();
  }

 private:
  Tick tick_ = 0;
  std::uint64_t parts_ = 0;  ///< bit i: part i of tick_
  std::uint32_t parts_expected_ = 0;
  std::uint32_t frame_revision_ = 0;
  std::uint32_t step_revision_ = 0;
  std::map<HandId, Tick> manifolds_;
};

}  // namespace tenon::haptic
