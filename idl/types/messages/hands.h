#pragma once

#include <array>
#include <cstdint>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// What goes from and to the device of one hand.
namespace tenon {

/// A device pose, mapped to the world by the client.
struct DeviceSample {
  std::uint32_t seq = 0;  ///< counts the client's ticks from 1; in lockstep the server tick it is for
  Pose X_WH;
  Twist V_WH;                 ///< [m/s], [rad/s], in W
  std::uint32_t buttons = 0;  ///< bit 0: the main switch
};

/// Sensed and driven axes of a device: bits 0..2 translation along x, y, z; 3..5 rotation about them.
inline constexpr std::uint32_t kAllDofs = 0x3F;
inline constexpr std::uint32_t kTranslationDofs = 0x07;

/// Stiffness of the coupling between a hand and the object that it moves.
struct HandStiffness {
  double translational = 0.0;  ///< [N/m] 0: not known, or no force
  double rotational = 0.0;     ///< [Nm/rad] 0: not known, or no torque
};

/// Pose of one hand's device, from its station to the server in every client tick.
struct DeviceInput {
  HandId hand;
  ClientId client;
  std::uint32_t server_epoch = 0;
  bool active = false;  ///< false: fault, stop or disarmed; the server holds the object still
  DeviceSample sample;
  /// [m] C_w, centre of the client's workspace (paper eq. 1). Reserved: the server does not read it yet
  Vector3 p_WC = Vector3::Zero();
};

/// What a station displays to one hand, for observers and recordings.
struct HandState {
  HandId hand;
  std::uint32_t seq = 0;  ///< of the client tick, as DeviceSample::seq
  Pose X_WH;
  Vector3 p_WC = Vector3::Zero();         ///< [m] as in DeviceInput
  Pose X_WO_local;                        ///< proxy pose of the local model; not used by the simulation
  Wrench F_Ho_W;                          ///< wrench displayed on the hand, about its origin
  std::uint32_t manifold_age = 0;         ///< [ticks] since the input that its contacts answer
  std::uint32_t safety_flags = 0;         ///< bit per active rule of devices/safety.h
  bool indexing = false;                  ///< the centre of the workspace is moving (paper eq. 1)
  std::array<std::uint8_t, 6> tactors{};  ///< intensities of a vibrotactile bracelet, 0..255
  float peak_force = 0.0F;                ///< [N] largest displayed since the last sample, this one included
};

/// Virtual fixture that guides a hand.
struct Guidance {
  HandId hand;
  Tick tick = 0;
  bool active = false;
  Pose X_WF;               ///< pose of the fixture
  double stiffness = 0.0;  ///< [N/m]
  double damping = 0.0;    ///< [Ns/m]
};

}  // namespace tenon
