#pragma once

#include "devices/safety.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/sigma7.h"

namespace tenon::devices {

inline constexpr double kTick = 1e-3;

inline DeviceState armed() {
  DeviceState state;
  state.forces_on = true;
  return state;
}

inline SafetyRequest requestForce(const Vector3& force, double age = 0.0) {
  SafetyRequest request;
  request.requested.F_Ho_D.force = force;
  request.age = age;
  return request;
}

/// A safety layer after 1 s of no force and 1 s of `force`: soft start and slew are over.
inline Safety settled(const DeviceCaps& caps, const Vector3& force, ClutchLatch* clutch = nullptr) {
  Safety safety(caps, clutch);
  for (int tick = 0; tick < 1010; ++tick) (void)safety.step({}, armed(), kTick);
  for (int tick = 0; tick < 1000; ++tick) (void)safety.step(requestForce(force), armed(), kTick);
  return safety;
}

inline const DeviceCaps kSigma = sigma7Model().caps;
inline const DeviceCaps kHug = hugArmModel().caps;
inline const DeviceCaps kFalcon = falconModel().caps;

}  // namespace tenon::devices
