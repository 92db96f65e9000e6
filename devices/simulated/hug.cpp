#include "devices/simulated/hug.h"

#include "idl/types/messages/hands.h"

namespace tenon::devices {

SimulatedModel hugArmModel() {
  SimulatedModel model;
  DeviceCaps& caps = model.caps;
  caps.model = "HUG arm (simulated)";
  caps.dof_mask = kAllDofs;
  caps.workspace_radius = 0.40;             // [assumed] half the robot's reach of 0.79 m
  caps.rotation_range = 2.6;                // [assumed]
  caps.indexing_radius = 0.2;               // [paper] section 4.3
  caps.indexing_gain = 1.5;                 // [paper] section 4.3
  caps.continuous_force = 50.0;             // [paper] "rarely exceeded"
  caps.peak_force = 150.0;                  // [paper]
  caps.command_limit = 50.0;                // [paper] limit in normal operation
  caps.thermal_time = 20.0;                 // [assumed]
  caps.torque = 10.0;                       // [assumed]; the wrist joints provide 38 Nm [published]
  caps.force_slew = 2000.0;                 // [assumed] full force in 25 ms
  caps.torque_slew = 200.0;                 // [assumed]
  caps.max_stiffness = 5000.0;              // [published] upper end of the robot's stiffness range
  caps.max_rotational_stiffness = 100.0;    // [assumed]
  caps.physical_damping = 10.0;             // [assumed] of the controller, 10 to 20 Ns/m
  caps.physical_rotational_damping = 0.15;  // [assumed]
  caps.injected_damping = 40.0;  // [assumed] below the value at which the lag of the velocity destabilises
  caps.injected_rotational_damping = 0.2;  // [assumed]
  caps.delay = 1e-3;                       // [assumed] one cycle of the robot's network interface
  caps.max_speed = 1.0;                    // [paper] v_max
  caps.rate = 1000.0;                      // [published] of that interface; joints run at 3 kHz [paper]
  caps.clutch_force = 80.0;                // [paper] "in any direction"
  caps.clutch_warning = 60.0;              // [assumed]
  // Geometric mean of the mass ellipsoid's axes (0.65, 0.9, 4.9 kg, from the robot's public model at four
  // postures); its dependence on direction and posture is not modelled.
  model.mass = 1.4;
  model.inertia = 0.01;              // [assumed]
  model.friction = 0.5;              // [assumed] residual after torque control
  model.rotational_friction = 0.02;  // [assumed]
  model.position_resolution = 1e-4;  // [assumed] from 0.01 degrees at the joints
  model.angle_resolution = 1.75e-4;  // [assumed] 0.01 degrees
  model.velocity_window = 5;         // [assumed]
  model.delay = 1;
  model.force_sensor = true;  // [paper] six-axis sensor at each wrist
  return model;
}

Hug::Hug(std::uint64_t seed)
    : clutch_(std::make_shared<MagneticClutch>()),
      right_(hugArmModel(), 2 * seed, clutch_),
      left_(hugArmModel(), 2 * seed + 1, clutch_) {}

Result<void> Hug::open() {
  if (auto opened = right_.open(); !opened) return opened;
  return left_.open();
}

}  // namespace tenon::devices
