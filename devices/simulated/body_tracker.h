#pragma once

#include <array>

#include "devices/tracker.h"

namespace tenon::devices {

/// Simulated tracker: sees each body exactly, where whoever simulates it has put it. No clock is read: its
/// readings have no time stamp.
///
/// Threads: one servo thread. Real-time: everything.
class BodyTracker : public Tracker {
 public:
  [[nodiscard]] bool tracks(TrackedBody /*body*/) const noexcept override { return true; }
  void read(TrackedBody body, TrackerReading& reading) noexcept override { reading = seen(body); }

  /// The body is at X_TB, and visible.
  void place(TrackedBody body, const Pose& X_TB) noexcept { seen(body) = {true, X_TB, 0}; }
  /// Its markers are covered.
  void hide(TrackedBody body) noexcept { seen(body).visible = false; }

 private:
  [[nodiscard]] TrackerReading& seen(TrackedBody body) noexcept {
    return seen_[static_cast<std::size_t>(body)];
  }

  std::array<TrackerReading, 3> seen_{};
};

/// `tracker`, if it is a simulated one; else null.
[[nodiscard]] inline BodyTracker* simulatedBodyTracker(Tracker& tracker) noexcept {
  return dynamic_cast<BodyTracker*>(&tracker);
}

}  // namespace tenon::devices
