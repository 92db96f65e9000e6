#pragma once

#include "devices/simulated/simulated_device.h"

namespace tenon {

/// Force Dimension sigma.7: six axes, for an instructor's desk.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel sigma7Model();

}  // namespace tenon
