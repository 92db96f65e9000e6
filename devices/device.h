#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "idl/types/ids.h"
#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon::devices {

/// What a device is opened with. What a make has no use for it ignores.
struct DeviceConfiguration {
  std::uint64_t seed = 1;  ///< varies the parameters of a simulated device
  std::string address;     ///< where it is: a port, host or socket; empty: the first one found
  std::string serial;      ///< serial number of the one to open; empty: the first one found
  /// How it is mounted: from its own frame M to the frame D that stations see. A turn about any axis; its
  /// place does not matter, since the workspace moves.
  Quaternion q_DM = Quaternion::Identity();
  bool dead_man = false;  ///< a simulated device has a dead man's switch, which who holds it presses
  bool paces = false;     ///< a simulated device has a clock of its own, which paces the loop
};

inline constexpr double kMaxMotorCounts =
    4096.0;  ///< [-] motor counts at which a command saturates, either sign

/// Capabilities and limits of a device. Where a device sets them it states each number's source and
/// certainty: [paper], [published] by the vendor or in the literature, [measured] or [assumed]. 0 for a limit
/// means that the device lacks the feature.
struct DeviceCaps {
  std::string model;
  std::string serial;                     ///< its serial number; empty: it has none
  std::uint32_t dof_mask = 0;             ///< sensed and actuated axes: kAllDofs, kTranslationDofs
  double workspace_radius = 0.0;          ///< [m] about the device's centre
  double rotation_range = 0.0;            ///< [rad] from the centre to the end stop, about any axis
  double indexing_radius = 0.0;           ///< [m] r_w of paper eq. 1
  double indexing_gain = 0.0;             ///< [1/s] lambda_w of paper eq. 1
  double continuous_force = 0.0;          ///< [N] without a time limit
  double peak_force = 0.0;                ///< [N] for a short time, see thermal_time
  double command_limit = 0.0;             ///< [N] largest commanded force, even if the motors could do more
  double thermal_time = 0.0;              ///< [s] time constant of motor heating
  double torque = 0.0;                    ///< [Nm] largest
  double force_slew = 500.0;              ///< [N/s] largest rate at which a force grows
  double torque_slew = 10.0;              ///< [Nm/s] likewise
  double max_stiffness = 0.0;             ///< [N/m] renderable
  double max_rotational_stiffness = 0.0;  ///< [Nm/rad] likewise
  double physical_damping = 0.0;          ///< [Ns/m] of the mechanics: b in K <= b / (T/2 + delay)
  double physical_rotational_damping = 0.0;  ///< [Nms/rad] likewise
  double injected_damping = 0.0;  ///< [Ns/m] largest virtual damping that its velocity signal allows
  double injected_rotational_damping = 0.0;  ///< [Nms/rad] likewise
  double delay = 0.0;           ///< [s] from a command to the force, in addition to the hold of one period
  double max_speed = 1.0;       ///< [m/s] above it the safety layer brakes
  double rate = 1000.0;         ///< [Hz] of the servo loop
  double force_quantum = 0.0;   ///< [N] of one motor count; commands saturate at kMaxMotorCounts
  double clutch_force = 0.0;    ///< [N] at which its magnetic clutch opens
  double clutch_warning = 0.0;  ///< [N] at which the safety layer warns of the clutch
  std::uint32_t tactors = 0;    ///< number of vibration motors
  std::uint32_t dead_man = 0;  ///< bit i: forces need button i, or another one of these, held; 0: they do not
  std::uint32_t arming = 0;    ///< bit i: who presses button i arms the station, as by its return key
  /// Bit i: while button i is held the device is decoupled from the scene (de-clutching), to be brought back
  /// into the middle of its workspace; 0: it has no button for that.
  std::uint32_t declutch = 0;
  double grip_range = 0.0;  ///< [m] from closed to open; 0: no gripper
};

enum class DeviceFault : std::uint8_t {
  kNone,
  kNonFinite,  ///< a commanded force was NaN or infinite
  kStale,      ///< watchdog: no write for too long
  kVelocity,   ///< faster than the device permits
  kForce,      ///< measured or commanded force above what the device permits
  kWorkspace,  ///< outside of what its kinematics permit
  kClutchOpen,
  kEmergencyStop,  ///< its own emergency stop
  kCommunication,  ///< readings do not arrive any more
};

/// One reading of a device, in its frame D: origin at the centre of the workspace; x right, y away from the
/// user, z up.
struct DeviceState {
  std::uint64_t seq = 0;  ///< number of the reading: another one for each that is new
  Pose X_DH;
  Twist V_DH;
  std::uint32_t buttons = 0;  ///< bit i: button i is pressed
  double grip = 0.0;          ///< [m] opening of the gripper; 0 without one
  std::int64_t stamp = 0;     ///< [ns] when it was measured, by std::chrono::steady_clock; 0: not known
  Wrench F_Ho_D_measured;     ///< on the hand, by a force sensor at the grip; zero without one
  bool forces_on = false;
  DeviceFault fault = DeviceFault::kNone;
};

/// Output of one servo cycle.
struct DeviceCommand {
  Wrench F_Ho_D;  ///< to display on the hand
  bool brake = false;
  std::array<std::uint8_t, 6> tactors{};  ///< vibration intensities, 0 to 255
};

/// What a hand is shown beside its force: for a device whose owner sees the scene through it.
struct HandView {
  bool active = false;             ///< contacts are rendered; otherwise there is no proxy
  bool in_contact = false;         ///< of its object
  Pose X_DS;                       ///< proxy of the hand
  Pose X_DO;                       ///< the object that it moves, at the proxy
  Vector3 p_WC = Vector3::Zero();  ///< [m] centre of the device in the scene: p_WH = p_WC + p_DH
  ObjectId object;                 ///< that it moves; invalid before the first contacts have arrived
};

/// Interface of a haptic device; independent of network and simulation.
///
/// States: open (reads, no forces), armed (forces on), fault (forces off until an operator resets it). A
/// command is held until the next one, and there is none before the first write after arm(); a watchdog of
/// the device turns the forces off when writes stop.
///
/// A device may pace the loop: then a cycle begins when it has a new reading (awaitReading). Of two that
/// could, a station is paced by the first one.
///
/// Threads: read, write and awaitReading from one servo thread, one cycle being read, then write; arm and
/// resetFault from any, while no other one uses the device. Real-time: read, write, disarm, awaitReading.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;
  [[nodiscard]] virtual const DeviceCaps& caps() const = 0;
  /// Forces on. Fails in a fault or when the device is not open; arming an armed device does nothing.
  [[nodiscard]] virtual Result<void> arm() = 0;
  /// Forces off, in any state; an engaged brake stays on until the device is armed.
  virtual void disarm() noexcept = 0;
  /// From fault to open. Called on behalf of an operator who has inspected the device.
  [[nodiscard]] virtual Result<void> resetFault() = 0;
  /// Whether its readings come by a clock of its own, which can be waited for: nominally each millisecond,
  /// and within 1e-4 of that in the long run. One that measures more often counts each n-th as a reading.
  [[nodiscard]] virtual bool paces() const noexcept { return false; }
  /// Waits for a reading that is newer than that of the last read(), `longest` at most; true: there is one.
  /// False at once where none can come.
  [[nodiscard]] virtual bool awaitReading(std::chrono::nanoseconds /*longest*/) noexcept { return false; }
  /// The newest reading; does not wait. Once the communication is lost: the last one, with the fault set.
  virtual void read(DeviceState& state) noexcept = 0;
  /// The command to display until the next write. Ignored unless armed; one that is not finite is a fault.
  virtual void write(const DeviceCommand& command) noexcept = 0;
  /// What a hand is shown from the next write on. Most devices show nothing.
  virtual void show(const HandView& /*view*/) noexcept {}
  /// The device behind one that only converts; otherwise itself.
  [[nodiscard]] virtual HapticDevice& inner() noexcept { return *this; }
};

/// Bimanual haptic device: one arm for each hand. A fault of one arm may stop both.
///
/// Threads: both arms from one servo thread. Real-time: as HapticDevice.
class BimanualDevice {
 public:
  virtual ~BimanualDevice() = default;
  [[nodiscard]] virtual HapticDevice& right() = 0;
  [[nodiscard]] virtual HapticDevice& left() = 0;
};

/// Text for a message to the operator.
[[nodiscard]] constexpr const char* toString(DeviceFault fault) noexcept {
  switch (fault) {
    case DeviceFault::kNone:
      return "none";
    case DeviceFault::kNonFinite:
      return "non-finite force command";
    case DeviceFault::kStale:
      return "command timeout";
    case DeviceFault::kVelocity:
      return "overspeed";
    case DeviceFault::kForce:
      return "force limit exceeded";
    case DeviceFault::kWorkspace:
      return "workspace limit exceeded";
    case DeviceFault::kClutchOpen:
      return "clutch open";
    case DeviceFault::kEmergencyStop:
      return "emergency stop";
    case DeviceFault::kCommunication:
      return "communication lost";
  }
  return "unknown";
}

}  // namespace tenon::devices
