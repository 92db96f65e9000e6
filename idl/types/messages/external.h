#pragma once

#include <cstdint>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// Inputs to the simulation from programs other than stations.
namespace tenon {

/// External wrench on an object. The server ignores one that is not finite, clamps it to 50 N and 5 Nm (about
/// what a haptic device exerts) and its lifetime to 100 ticks, and fades it linearly over that lifetime
/// (ForceBuffer in server/simulation/force_buffer.h).
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
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] for which it replaces the own tracker, if any; at most 1000
};

}  // namespace tenon
