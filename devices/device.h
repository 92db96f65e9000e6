#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "idl/types/ids.h"
#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon {

/// What a device can do. Numbers with their source and certainty stand where each device fills them in.
struct DeviceCaps {
  std::string model;
  std::uint32_t dof_mask = 0;      ///< sensed and driven axes: kAllDofs, kTranslationDofs
  double workspace_radius = 0.0;   ///< [m] about the device's centre
  double indexing_radius = 0.0;    ///< r_w of paper eq. 1
  double indexing_gain = 0.0;      ///< lambda_w [1/s]
  double continuous_force = 0.0;   ///< [N] command ceiling
  double peak_force = 0.0;         ///< [N]
  double torque = 0.0;             ///< [Nm]
  double max_stiffness = 0.0;      ///< [N/m] it can render
  double max_rotational_stiffness = 0.0;
  double physical_damping = 0.0;   ///< [Ns/m] of its own, for K < 2b/T
  double max_speed = 1.0;          ///< [m/s] beyond this the safety layer brakes
  double rate = 1000.0;            ///< [Hz]
  std::uint32_t tactors = 0;
};

enum class DeviceFault : std::uint8_t {
  kNone, kNotANumber, kStale, kVelocity, kForce, kWorkspace, kClutchOpen, kEmergencyStop, kCommunication,
};

/// What a device says, in its own frame D (origin at the middle of its workspace, axes as the user faces it:
/// x right, y away, z up).
struct DeviceState {
  std::uint64_t seq = 0;
  Pose X_DH;
  Twist V_DH;
  std::uint32_t buttons = 0;
  Wrench F_Ho_D_measured;   ///< by a force sensor at the grip, on the hand; zero without one
  bool forces_on = false;
  DeviceFault fault = DeviceFault::kNone;
};

struct DeviceCommand {
  Wrench F_Ho_D;            ///< to display on the hand
  bool brake = false;
  std::array<std::uint8_t, 6> tactors{};
};

/// A haptic device of any make. One file pair each; knows neither network nor simulation.
///
/// Threads: read and write from one servo thread. Real-time: read, write.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;
  [[nodiscard]] virtual const DeviceCaps& caps() const = 0;
  [[nodiscard]] virtual Result<void> arm() = 0;    ///< forces on
  virtual void disarm() noexcept = 0;              ///< forces off; always possible
  [[nodiscard]] virtual Result<void> resetFault() = 0;  ///< by the operator, after looking
  virtual void read(DeviceState& state) noexcept = 0;
  virtual void write(const DeviceCommand& command) noexcept = 0;
};

}  // namespace tenon
