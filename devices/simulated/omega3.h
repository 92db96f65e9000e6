#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon::devices {

/// Force Dimension omega.3: three axes, the stiffest of the desktop devices.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel omega3Model();

}  // namespace tenon::devices
