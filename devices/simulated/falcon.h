#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon::devices {

/// Novint Falcon: three axes, a consumer device.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel falconModel();

}  // namespace tenon::devices
