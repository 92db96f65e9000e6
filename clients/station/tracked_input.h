#pragma once

#include "idl/types/messages/hands.h"
#include "idl/types/spatial.h"

namespace tenon::station {

/// Fills the input of a tracked body part that is at X_WH, `dt` [s] after its last reading. Its velocity is a
/// difference quotient; zero at the first reading, and where it jumps faster than people move: a tracker
/// that finds its markers again, or a workspace whose centre is set anew at a resume.
///
/// Real-time: yes.
inline void setTrackedPose(DeviceInput& input, const Pose& X_WH, double dt) noexcept {
  constexpr double kMostSpeed = 15.0;         // [m/s]
  constexpr double kMostAngularSpeed = 40.0;  // [rad/s]
  const Displacement moved = displacement(input.sample.X_WH, X_WH);
  const bool is_continuous = input.active && moved.translation.norm() < kMostSpeed * dt &&
                             moved.rotation.norm() < kMostAngularSpeed * dt;
  input.sample.X_WH = X_WH;
  input.sample.V_WH = is_continuous ? Twist{moved.translation / dt, moved.rotation / dt} : Twist{};
  input.active = true;
}

}  // namespace tenon::station
