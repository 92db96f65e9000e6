#pragma once

#include <cstdint>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// Inputs to the simulation from programs other than stations.
namespace tenon {

/// External wrench on an object. The server ignores one that is not finite, clamps it to the force of a
/// haptic device, and fades it linearly over its lifetime (limits: server/simulation/force_buffer.h).
struct ForceContribution {
  std::uint32_t source = 0;  ///< its cell of the force accumulator
  ClientId client;
  ObjectId object;
  Wrench F_Oo_W;
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] after which it is 0 unless repeated
};

/// Pose of an object as an external tracker measured it.
struct ExternalPose {
  ObjectId object;
  ClientId client;
  Pose X_WO;
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] reserved
};

}  // namespace tenon
