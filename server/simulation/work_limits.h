#pragma once

#include <cstdint>

namespace tenon::simulation {

/// Work limits of a tick, in counted points instead of measured time: equal on every machine.
struct WorkLimits {
  std::uint64_t points = 0;     ///< shell points tested per tick; 0: unlimited, no level is skipped
  double critical_load = 70.0;  ///< [%] load of a pair (paper eq. 2) from which on it skips a level

  [[nodiscard]] bool any() const { return points > 0; }
};

}  // namespace tenon::simulation
