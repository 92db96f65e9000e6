#pragma once

#include <cstdint>

#include "clients/simulated_person/perception.h"
#include "clients/simulated_person/reach_controller.h"

namespace tenon::simulated_person {

/// De-clutching by the hand of a simulated person: where contact keeps the workspace from following (eq. 1)
/// and the device is at its end, the person presses the device's button, brings the device over to the other
/// side, releases the button, and goes on once the force is back.
///
/// Threads: one. Real-time: everything.
class Declutching {
 public:
  void reset() noexcept { enter(Phase::kNone); }
  /// Advances by `dt` [s]; `at_end`: the hand is wanted beyond the reach of the device. Returns whether the
  /// person is busy with it, so that all else waits.
  bool step(const HandPerception& hand, bool at_end, double dt) noexcept;

  [[nodiscard]] bool busy() const noexcept { return phase_ != Phase::kNone; }
  /// The button is held.
  [[nodiscard]] bool presses() const noexcept { return phase_ == Phase::kPress || phase_ == Phase::kReturn; }
  /// X_DI, the pose that the arm is to move the device to while busy().
  [[nodiscard]] const Pose& intendedDevicePose() const noexcept { return reach_controller_.pose(); }

 private:
  enum class Phase : std::uint8_t { kNone, kPress, kReturn, kRelease };
  void enter(Phase phase) noexcept;

  Phase phase_ = Phase::kNone;
  double phase_time_ = 0.0;   // [s]
  double at_end_time_ = 0.0;  // [s] without interruption
  Pose X_DG_;                 // where the device is brought to
  ReachController reach_controller_;
};

}  // namespace tenon::simulated_person
