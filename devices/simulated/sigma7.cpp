#include "devices/simulated/sigma7.h"

#include "idl/types/messages/hands.h"

namespace tenon::devices {

SimulatedModel sigma7Model() {
  SimulatedModel model;
  DeviceCaps& caps = model.caps;
  caps.model = "sigma.7 (simulated)";
  caps.dof_mask = kAllDofs;
  caps.workspace_radius = 0.060;  // [published] Tobergte 2011: sphere of 120 mm
  caps.rotation_range = 1.2;      // [assumed] the narrowest of its axes is 140 degrees
  caps.indexing_radius = 0.035;   // [assumed] indexing acts in the outer 25 mm
  caps.indexing_gain = 10.0;      // [assumed] 0.25 m/s at the rim
  caps.continuous_force = 12.0;   // [published] limit of CHAI3D
  caps.peak_force = 20.0;         // [published]
  caps.command_limit = 20.0;
  caps.thermal_time = 10.0;                 // [assumed]
  caps.torque = 0.4;                        // [published]
  caps.force_slew = 500.0;                  // [assumed]
  caps.torque_slew = 10.0;                  // [assumed]
  caps.max_stiffness = 4000.0;              // [published] CHAI3D; the passivity condition allows less
  caps.max_rotational_stiffness = 1.0;      // [published] CHAI3D
  caps.physical_damping = 1.0;              // [assumed]
  caps.physical_rotational_damping = 2e-3;  // [assumed]
  caps.injected_damping = 20.0;             // [assumed] below CHAI3D's maximum, 30 Ns/m
  caps.injected_rotational_damping = 0.03;  // [assumed] below CHAI3D's maximum, 0.07 Nms/rad
  caps.max_speed = 0.5;                     // [assumed] for desktop devices
  caps.rate = 1000.0;                       // [published] up to 4 kHz
  // [assumed] a foot switch
  caps.declutch = SimulatedDevice::kDeclutchButton;
  model.mass = 0.35;                   // [assumed]
  model.inertia = 5e-4;                // [assumed]
  model.friction = 0.3;                // [assumed]
  model.rotational_friction = 5e-3;    // [assumed]
  model.position_resolution = 1.5e-6;  // [published]
  model.angle_resolution = 2.27e-4;    // [published] 0.013 degrees
  model.velocity_window = 20;          // [published] the vendor's default
  return model;
}

}  // namespace tenon::devices
