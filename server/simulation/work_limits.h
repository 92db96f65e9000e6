#pragma once

#include <cstdint>

namespace tenon {

/// How much work a tick may be. Counted, never measured: the same on every machine.
struct WorkLimits {
  std::uint64_t points = 0;     ///< tested in a tick; 0: as many as there are, nothing is left out
  double critical_load = 70.0;  ///< [%] load of a pair (paper eq. 2) from which on it leaves out a level

  [[nodiscard]] bool any() const { return points > 0; }
};

}  // namespace tenon
