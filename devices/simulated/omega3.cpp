#include "devices/simulated/omega3.h"

#include "idl/types/messages/hands.h"

namespace tenon::devices {

SimulatedModel omega3Model() {
  SimulatedModel model;
  DeviceCaps& caps = model.caps;
  caps.model = "omega.3 (simulated)";
  caps.dof_mask = kTranslationDofs;
  caps.workspace_radius = 0.075;  // [published] CHAI3D
  caps.indexing_radius = 0.045;   // [assumed] indexing acts in the outer 30 mm
  caps.indexing_gain = 8.0;       // [assumed] 0.24 m/s at the rim
  caps.continuous_force = 12.0;   // [published]
  caps.peak_force = 12.0;         // [published]
  caps.command_limit = 12.0;
  caps.force_slew = 500.0;       // [assumed]
  caps.max_stiffness = 5000.0;   // [published] CHAI3D; the passivity condition allows less
  caps.physical_damping = 1.0;   // [assumed]
  caps.injected_damping = 20.0;  // [assumed] below CHAI3D's maximum, 30 Ns/m
  caps.max_speed = 0.5;          // [assumed] for desktop devices
  caps.rate = 1000.0;            // [published]
  // [published] the button of its grip, to be assigned
  caps.declutch = SimulatedDevice::kDeclutchButton;
  model.mass = 0.2;                  // [assumed]
  model.friction = 0.3;              // [assumed]
  model.position_resolution = 1e-5;  // [published] better than 10 um
  model.velocity_window = 20;        // [published] the vendor's default
  return model;
}

}  // namespace tenon::devices
