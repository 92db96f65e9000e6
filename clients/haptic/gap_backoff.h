#pragma once

#include <algorithm>

namespace tenon::haptic {

/// Exponential back-off of the force's return after gaps in quick succession.
///
/// Each return re-anchors the hand where it went without a force. On a link whose delay swings about the
/// fresh limit that would happen ten times a second, and a hand that presses would drift to the end of its
/// workspace. So the first gap ends with the first fresh contacts, and each one that follows within kCalm
/// once they have been fresh for twice as long as after the last one, kFirst to kMost.
///
/// Threads: one. Real-time: everything.
class GapBackoff {
 public:
  static constexpr double kCalm = 1.0;   ///< [s] of fresh contacts after which a gap is a first one
  static constexpr double kFirst = 0.1;  ///< [s] after the second gap
  static constexpr double kMost = 0.8;   ///< [s] shorter than kCalm

  /// One cycle of `dt` [s]; `fresh`: the contacts are no older than the fresh limit. Whether they may be
  /// rendered.
  bool step(bool fresh, double dt) noexcept {
    if (!fresh && fresh_) wait_ = fresh_time_ >= kCalm ? 0.0 : std::clamp(2.0 * wait_, kFirst, kMost);
    fresh_time_ = fresh ? fresh_time_ + dt : 0.0;
    fresh_ = fresh;
    return fresh && fresh_time_ >= wait_;
  }

 private:
  bool fresh_ = false;
  double fresh_time_ = 0.0;  ///< [s] since the last gap
  double wait_ = 0.0;        ///< [s] of fresh contacts before they are rendered
};

}  // namespace tenon::haptic
