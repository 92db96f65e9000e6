#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon {

/// Force Dimension omega.3: three axes, the stiffest of the desk devices.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel omega3Model();

}  // namespace tenon
