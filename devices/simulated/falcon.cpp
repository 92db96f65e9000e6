#include "devices/simulated/falcon.h"

#include "idl/types/messages/hands.h"

namespace tenon::devices {

SimulatedModel falconModel() {
  SimulatedModel model;
  DeviceCaps& caps = model.caps;
  caps.model = "Falcon (simulated)";
  caps.dof_mask = kTranslationDofs;
  caps.workspace_radius = 0.040;  // [published] CHAI3D
  caps.indexing_radius = 0.022;   // [assumed] indexing acts in the outer 18 mm
  caps.indexing_gain = 14.0;      // [assumed] 0.25 m/s at the rim
  caps.continuous_force = 6.0;    // [assumed]
  caps.peak_force = 8.0;          // [published]
  caps.command_limit = 8.0;
  caps.thermal_time = 10.0;  // [assumed]
  caps.force_slew = 500.0;   // [assumed]
  // Each of its three motors takes a command of +-4096 counts, and the public driver lets a larger one wrap
  // to the opposite sign. Modelled per Cartesian axis instead of per motor [assumed].
  caps.force_quantum = caps.peak_force / kMaxMotorCounts;
  caps.max_stiffness = 3000.0;   // [published] CHAI3D; the passivity condition allows less
  caps.physical_damping = 3.0;   // [assumed]
  caps.injected_damping = 15.0;  // [assumed] below CHAI3D's maximum, 20 Ns/m
  caps.delay = 1e-3;             // [assumed] one frame of USB
  caps.max_speed = 0.5;          // [assumed] for desktop devices
  caps.rate = 1000.0;            // [published]
  // [published] one of the four buttons of its grip
  caps.declutch = SimulatedDevice::kDeclutchButton;
  model.mass = 0.3;                  // [assumed]
  model.friction = 0.6;              // [assumed]
  model.position_resolution = 4e-5;  // [measured] from its kinematics: 29 to 49 um per count
  model.velocity_window = 10;        // [assumed]
  model.delay = 1;
  return model;
}

}  // namespace tenon::devices
