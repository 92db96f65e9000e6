#pragma once

#include <cstdint>

#include "idl/types/spatial.h"

namespace tenon::simulated_person {

/// Parameters of a simulated person: speed limits, reaction time and aiming errors.
struct PersonOptions {
  std::uint64_t seed = 1;           ///< of the aiming errors; equal seeds give bit-equal motion
  double max_speed = 0.30;          ///< [m/s] of the intended hand pose; the arm may overshoot it slightly
  double max_turn_speed = 1.2;      ///< [rad/s] likewise
  unsigned reaction_ticks = 150;    ///< [ticks] delay from perception to action
  double aim_error_min = 0.003;     ///< [m] lateral aiming error: drawn uniformly between min and max
  double aim_error_max = 0.005;     ///< [m]
  double aim_angle_min = 0.0175;    ///< [rad] angular aiming error: likewise
  double aim_angle_max = 0.035;     ///< [rad]
  int misplaced_mount = -1;         ///< index (from 0) of the mount inserted at a wrong pose; -1: none
  double misplaced_offset = 0.024;  ///< [m] lateral aiming error of that mount; never corrected
};

}  // namespace tenon::simulated_person
