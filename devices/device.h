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
/// A zero limit means: the device has no such thing.
struct DeviceCaps {
  std::string model;
  std::uint32_t dof_mask = 0;     ///< sensed and driven axes: kAllDofs, kTranslationDofs
  double workspace_radius = 0.0;  ///< [m] about the device's centre
  double indexing_radius = 0.0;   ///< r_w of paper eq. 1
  double indexing_gain = 0.0;     ///< lambda_w [1/s]
  double continuous_force = 0.0;  ///< [N] it can hold for ever
  double peak_force = 0.0;        ///< [N] its motors can do for a moment
  double command_limit = 0.0;     ///< [N] never asked for more than this, whatever the motors could do
  double thermal_time = 0.0;      ///< [s] of the motors' warming, between continuous and peak
  double torque = 0.0;            ///< [Nm]
  double force_slew = 500.0;      ///< [N/s] at which a force may grow
  double torque_slew = 10.0;      ///< [Nm/s]
  double max_stiffness = 0.0;     ///< [N/m] it can render
  double max_rotational_stiffness = 0.0;     ///< [Nm/rad]
  double physical_damping = 0.0;             ///< [Ns/m] of its own, for K < 2b/T
  double physical_rotational_damping = 0.0;  ///< [Nms/rad]
  double injected_damping = 0.0;             ///< [Ns/m] at most, that its velocity signal allows to add
  double injected_rotational_damping = 0.0;  ///< [Nms/rad]
  double delay = 0.0;           ///< [s] from a command to the force, on top of the hold of one period
  double max_speed = 1.0;       ///< [m/s] beyond this the safety layer brakes
  double rate = 1000.0;         ///< [Hz]
  double force_quantum = 0.0;   ///< [N] of one motor word; the word saturates at +-4096
  double clutch_force = 0.0;    ///< [N] at which its magnetic clutch opens
  double clutch_warning = 0.0;  ///< [N]
  std::uint32_t tactors = 0;
};

enum class DeviceFault : std::uint8_t {
  kNone,
  kNotANumber,
  kStale,
  kVelocity,
  kForce,
  kWorkspace,
  kClutchOpen,
  kEmergencyStop,
  kCommunication,
};

/// What a device says, in its own frame D (origin at the middle of its workspace, axes as the user faces it:
/// x right, y away, z up).
struct DeviceState {
  std::uint64_t seq = 0;
  Pose X_DH;
  Twist V_DH;
  std::uint32_t buttons = 0;
  Wrench F_Ho_D_measured;  ///< by a force sensor at the grip, on the hand; zero without one
  bool forces_on = false;
  DeviceFault fault = DeviceFault::kNone;
};

struct DeviceCommand {
  Wrench F_Ho_D;  ///< to display on the hand
  bool brake = false;
  std::array<std::uint8_t, 6> tactors{};
};

/// A haptic device of any make. One file pair each; knows neither network nor simulation.
///
/// Opened, it reads but does not push; armed, it pushes; a fault takes the forces off and stays until an
/// operator resets it. A command is held until the next one, but not for ever: a device whose servo stops
/// writing takes its forces off by itself.
///
/// Threads: read and write from one servo thread, one cycle being read, then write. Real-time: read, write,
/// disarm.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;
  [[nodiscard]] virtual const DeviceCaps& caps() const = 0;
  [[nodiscard]] virtual Result<void> arm() = 0;  ///< forces on
  virtual void disarm() noexcept = 0;  ///< forces off; always possible; a brake stays on until armed
  [[nodiscard]] virtual Result<void> resetFault() = 0;  ///< by the operator, after looking
  virtual void read(DeviceState& state) noexcept = 0;
  virtual void write(const DeviceCommand& command) noexcept = 0;
};

/// Two arms of one machine, one for each hand; what stops one may stop both.
///
/// Threads: both arms from one servo thread. Real-time: as HapticDevice.
class DevicePair {
 public:
  virtual ~DevicePair() = default;
  [[nodiscard]] virtual HapticDevice& right() = 0;
  [[nodiscard]] virtual HapticDevice& left() = 0;
};

/// As a clause of a message to the operator.
[[nodiscard]] constexpr const char* toString(DeviceFault fault) noexcept {
  switch (fault) {
    case DeviceFault::kNone:
      return "none";
    case DeviceFault::kNotANumber:
      return "a force that is not a number";
    case DeviceFault::kStale:
      return "its servo stopped writing";
    case DeviceFault::kVelocity:
      return "too fast";
    case DeviceFault::kForce:
      return "too much force";
    case DeviceFault::kWorkspace:
      return "outside its workspace";
    case DeviceFault::kClutchOpen:
      return "clutch open";
    case DeviceFault::kEmergencyStop:
      return "emergency stop";
    case DeviceFault::kCommunication:
      return "no answer";
  }
  return "unknown";
}

}  // namespace tenon
