#pragma once

#include <cmath>

#include "idl/types/ids.h"

namespace tenon::test {

/// Triangle wave in [-1, 1] of `period` [ticks]; computed without functions of the C library, so bit-equal on
/// every processor.
inline double triangleWave(Tick tick, Tick period) {
  const auto phase = static_cast<double>(tick % period) / static_cast<double>(period);
  return std::abs(4.0 * phase - 2.0) - 1.0;
}

}  // namespace tenon::test
