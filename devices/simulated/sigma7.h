#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon::devices {

/// Force Dimension sigma.7: six axes, a desktop device for an instructor.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel sigma7Model();

}  // namespace tenon::devices
