#pragma once

#include <cstdint>

#include "idl/types/spatial.h"

namespace tenon {

/// How a simulated person is made: what limits her and how well she aims.
struct PersonOptions {
  std::uint64_t seed = 1;
  double max_speed = 0.30;        ///< [m/s] she aims for; a swinging arm adds a little
  double max_turn_speed = 1.2;    ///< [rad/s]
  unsigned reaction_ticks = 150;  ///< from seeing or feeling to doing
  double aim_error_min = 0.003;   ///< [m] she aims beside the target, by a seeded amount between these two
  double aim_error_max = 0.005;   ///< [m]
  double aim_angle_min = 0.0175;  ///< [rad] likewise
  double aim_angle_max = 0.035;   ///< [rad]
  int stubborn_mount = -1;        ///< the n-th mount (from 0) in which she is sure of a wrong place; -1: none
  double stubborn_offset = 0.024;  ///< [m] beside the target, then
};

}  // namespace tenon
