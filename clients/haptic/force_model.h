#pragma once

#include <cstdint>

#include "clients/haptic/world_view.h"
#include "idl/types/spatial.h"

namespace tenon::haptic {

/// Result of one step of a force model.
struct LocalProxy {
  bool active = false;  ///< there are contacts to render; otherwise the force is zero
  /// Since the last step a body jumped, the object changed or `active` ended: the force has to start from
  /// zero.
  bool discontinuous = false;
  bool touching = false;              ///< a contact constraint is active
  Pose X_WO;                          ///< the object, kept out of all contact half-spaces
  Pose X_WS;                          ///< proxy pose S of the hand
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad] likewise
};

enum class ForceModelKind : std::uint8_t {
  kManifold,   ///< the contacts that the server lists
  kSceneCopy,  ///< contacts that the station computes from its copy of the scene
};

/// Where the proxy of a hand's object is: what the coupling pulls the hand to. No model renders a force that
/// came over the network, and every model solves for the present pose of the device.
///
/// Threads: one. Real-time: everything.
class ForceModel {
 public:
  ForceModel() = default;
  virtual ~ForceModel() = default;
  ForceModel(const ForceModel&) = delete;
  ForceModel& operator=(const ForceModel&) = delete;

  /// One cycle with the device at X_WH.
  virtual const LocalProxy& step(const Pose& X_WH, const WorldView& world) noexcept = 0;
  [[nodiscard]] virtual const LocalProxy& proxy() const noexcept = 0;
  /// The contacts are not a continuation of those before: another object, or a jump of a body.
  [[nodiscard]] virtual bool jumped() const noexcept = 0;
  /// [ticks] so far in which the object was farther than the listed contacts are valid.
  [[nodiscard]] virtual std::uint64_t beyondValidity() const noexcept = 0;
};

}  // namespace tenon::haptic
