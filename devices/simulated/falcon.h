#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon {

/// Novint Falcon: three axes, the cheapest of all.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel falconModel();

}  // namespace tenon
