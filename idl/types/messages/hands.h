#pragma once

#include <array>
#include <cstdint>

#include "idl/types/fixed_vector.h"
#include "idl/types/ids.h"
#include "idl/types/spatial.h"

/// What goes from and to the device of one hand.
namespace tenon {

/// A device pose, mapped to the world by the client; in messages with the steps of idl/types/resolution.h.
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

/// [ticks] limits of a hand that sends nothing, on a link without faults, and the most that a link may ask
/// for.
inline constexpr std::uint32_t kFreezeTicks = 50, kMostFreezeTicks = 150;
inline constexpr std::uint32_t kParkTicks = 1000, kMostParkTicks = 2000;

/// Reaction to the age of a hand's newest device sample.
struct HandLimits {
  std::uint32_t freeze_ticks = kFreezeTicks;  ///< [ticks] above it the hand is held still
  std::uint32_t park_ticks = kParkTicks;      ///< [ticks] from it on it counts as absent

  bool operator==(const HandLimits&) const = default;
};

/// Samples before the newest one that an input carries.
inline constexpr std::size_t kEarlierSamples = 2;

/// Ticks between two inputs of a hand, at most.
inline constexpr std::uint8_t kMostInputPeriod = 20;

/// Pose of one hand's device, from its station to the server every `period` client ticks.
struct DeviceInput {
  HandId hand;
  ClientId client;
  std::uint32_t server_epoch = 0;
  bool active = false;  ///< false: fault, stop or disarmed; the server holds the object still
  /// [ticks] 1 to kMostInputPeriod: from one input of this hand to the next; above 1 the server fills the
  /// ticks between them
  std::uint8_t period = 1;
  DeviceSample sample;
  /// The samples before it, newest first, in case their inputs are lost; none where the link loses nothing
  /// or the period is above 1.
  FixedVector<DeviceSample, kEarlierSamples> earlier;
};

/// What a station displays to one hand, for observers and recordings.
struct HandState {
  HandId hand;
  std::uint32_t seq = 0;  ///< of the client tick, as DeviceSample::seq
  Pose X_WH;
  Vector3 p_WC = Vector3::Zero();         ///< [m] C_w, centre of the client's workspace (paper eq. 1)
  Pose X_WO_local;                        ///< proxy pose of the local model; not used by the simulation
  Wrench F_Ho_W;                          ///< wrench displayed on the hand, about its origin
  std::uint32_t manifold_age = 0;         ///< [ticks] since the input that its contacts answer
  std::uint32_t safety_flags = 0;         ///< bit per active rule of devices/safety.h
  bool indexing = false;                  ///< the centre of the workspace is moving (paper eq. 1)
  std::array<std::uint8_t, 6> tactors{};  ///< intensities of a vibrotactile bracelet, 0..255
  float peak_force = 0.0F;                ///< [N] largest displayed since the last sample, this one included
  float guidance_force = 0.0F;  ///< [N] of the virtual fixture, in what the safety layer was asked for
};

/// What a virtual fixture does with a hand.
enum class GuidanceMode : std::uint32_t {
  kOff,
  kLead,    ///< pulls the hand to the fixture
  kResist,  ///< holds back what leads away from the fixture; towards it the hand is free
};

/// Where a virtual fixture leaves the hand free. F is the fixture's frame.
enum class FixtureKind : std::uint32_t {
  kPose,   ///< nowhere: the hand belongs at the origin of F, and turned as F if there is a rotational
           ///< stiffness
  kAxis,   ///< along z of F, through its origin
  kPlane,  ///< in the plane of x and y of F
  kTube,   ///< within `radius` of the axis
};

/// Virtual fixture that guides a hand: a spring and a damper, which the hand's station evaluates. Sent in
/// each tick; what is not renewed ends.
struct Guidance {
  HandId hand;  ///< that is guided
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  std::uint32_t choice = 0;  ///< counts what was chosen: another number is another fixture
  GuidanceMode mode = GuidanceMode::kOff;
  FixtureKind kind = FixtureKind::kPose;
  HandId guide;  ///< the hand that guides
  Pose X_WF;
  double radius = 0.0;                ///< [m] of a tube
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad] 0: the hand turns freely
  double damping = 0.0;               ///< [Ns/m]
};

}  // namespace tenon
