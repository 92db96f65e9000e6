#pragma once

#include <cstdint>

#include "idl/types/spatial.h"

namespace tenon::devices {

/// What a tracker follows beside the hands of haptic devices.
enum class TrackedBody : std::uint8_t { kHead, kForearm, kPart };

/// One reading of a tracker.
struct TrackerReading {
  bool visible = false;    ///< false: the body is not seen, and the rest is the last that was
  Pose X_TB;               ///< of the body in the tracker's frame T, whose axes are those of W
  std::int64_t stamp = 0;  ///< [ns] when it was measured, by std::chrono::steady_clock; 0: not known
};

/// Interface of a tracker: poses of a head, a forearm or a part, by markers, cameras or inertial sensors.
///
/// Threads: one servo thread. Real-time: all.
class Tracker {
 public:
  virtual ~Tracker() = default;
  /// Whether it can follow `body`.
  [[nodiscard]] virtual bool tracks(TrackedBody body) const noexcept = 0;
  /// The newest reading; does not wait.
  virtual void read(TrackedBody body, TrackerReading& reading) noexcept = 0;
};

}  // namespace tenon::devices
