#include "devices/simulated/falcon.h"

#include "idl/types/messages.h"

namespace tenon {

SimulatedModel falconModel() {
  SimulatedModel model;
  DeviceCaps& caps = model.caps;
  caps.model = "Falcon (simulated)";
  caps.dof_mask = kTranslationDofs;
  caps.workspace_radius = 0.040;  // [published] CHAI3D
  caps.indexing_radius = 0.022;   // [assumed] the outer 18 mm drive the workspace ...
  caps.indexing_gain = 14.0;      // [assumed] ... at 0.25 m/s at the edge
  caps.continuous_force = 6.0;    // [assumed]
  caps.peak_force = 8.0;          // [published]
  caps.command_limit = 8.0;
  caps.thermal_time = 10.0;  // [assumed]
  caps.force_slew = 500.0;   // [assumed]
  // Its three motors take a word of +-4096 each and a larger one turns the sign round; modelled per axis, as
  // if the legs stood along x, y, z [assumed].
  caps.force_quantum = caps.peak_force / 4096.0;
  caps.max_stiffness = 3000.0;       // [published] CHAI3D; its own damping and delay allow less
  caps.physical_damping = 3.0;       // [assumed]
  caps.injected_damping = 15.0;      // [assumed] under CHAI3D's largest, 20 Ns/m
  caps.delay = 1e-3;                 // [assumed] one frame of USB
  caps.max_speed = 0.5;              // [assumed] desk devices
  caps.rate = 1000.0;                // [published]
  model.mass = 0.3;                  // [assumed]
  model.friction = 0.6;              // [assumed]
  model.position_resolution = 4e-5;  // [measured] on its kinematics: 29..49 um a count
  model.velocity_window = 10;        // [assumed]
  model.delay = 1;
  return model;
}

}  // namespace tenon
