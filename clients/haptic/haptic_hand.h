#pragma once

#include <cstdint>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "clients/haptic/workspace.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/fixed_vector.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"

namespace tenon::haptic {

/// State changes of a hand within one millisecond, for the event log.
struct HandEvents {
  FixedVector<devices::Intervention, 8> interventions;  ///< begins and ends of safety rules
  bool fault_began = false;
  bool indexing_began = false;
  bool indexing_ended = false;
  bool stale_began = false;
  bool beyond_validity_began = false;
};

/// Haptic loop of one hand at 1 kHz: read device, indexing, local model, virtual coupling, safety layer,
/// write device. Also composes the messages to the server (input) and to the other participants (state).
///
/// Every force passes the safety layer (devices/safety.h).
///
/// Threads: one. Real-time: step, receive.
class HapticHand {
 public:
  /// Parameters of workspace and coupling come from the device's capabilities. `device` and `clutch` outlive
  /// the hand; `clutch` is shared by the arms of a bimanual device, null for a single device.
  explicit HapticHand(devices::HapticDevice& device, devices::ClutchLatch* clutch = nullptr);

  /// Places the workspace so that the hand is at p_WH now, and arms the device if `armed`. Fails when it
  /// cannot be armed.
  Result<void> begin(HandId hand, ClientId client, const Vector3& p_WH, bool armed);
  void receive(const HandManifold& manifold) noexcept { local_.receive(manifold); }
  /// One cycle of `dt` [s]; `seq` numbers the input.
  void step(std::uint32_t seq, const WorldView& world, double dt) noexcept;
  /// False: forces off, brake on, input inactive. True: resets the safety layer and arms the device unless it
  /// is in fault. See Arming, which decides it.
  void permitForces(bool permitted) noexcept;
  /// Forces off.
  void end() noexcept { device_.disarm(); }

  [[nodiscard]] HandId id() const noexcept { return input_.hand; }
  [[nodiscard]] const DeviceInput& input() const noexcept { return input_; }
  [[nodiscard]] const HandState& state() const noexcept { return state_; }
  [[nodiscard]] const HandEvents& events() const noexcept { return events_; }
  [[nodiscard]] const devices::DeviceState& device() const noexcept { return device_state_; }
  [[nodiscard]] const devices::DeviceCaps& caps() const noexcept { return device_.caps(); }
  [[nodiscard]] Workspace& workspace() noexcept { return workspace_; }
  [[nodiscard]] const LocalModel& local() const noexcept { return local_; }
  [[nodiscard]] const Pose& pose() const noexcept { return input_.sample.X_WH; }
  [[nodiscard]] bool inContact() const noexcept { return in_contact_; }

 private:
  void updateOutputs(std::uint32_t seq, const WorldView& world, const Twist& V_WH) noexcept;
  void updateEvents() noexcept;

  devices::HapticDevice& device_;
  Workspace workspace_;
  LocalModel local_;
  Coupling coupling_;
  devices::Safety safety_;
  devices::DeviceState device_state_;
  DeviceInput input_;
  HandState state_;
  HandEvents events_;
  std::uint64_t beyond_count_ = 0;  // of LocalModel::beyondValidity() at the last step
  bool fault_ = false;
  bool beyond_validity_ = false;
  bool stale_ = false;
  bool in_contact_ = false;
  bool permitted_ = true;
};

}  // namespace tenon::haptic
