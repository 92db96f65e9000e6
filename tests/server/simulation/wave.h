#pragma once

#include <cmath>

#include "idl/types/ids.h"

namespace tenon::test {

/// To and fro between -1 and 1 at an even speed: no function of the C library, so the same everywhere.
inline double wave(Tick tick, Tick period) {
  const auto phase = static_cast<double>(tick % period) / static_cast<double>(period);
  return std::abs(4.0 * phase - 2.0) - 1.0;
}

}  // namespace tenon::test
