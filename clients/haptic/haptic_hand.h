#pragma once

#include <cstdint>

#include "clients/haptic/coupling.h"
#include "clients/haptic/local_model.h"
#include "clients/haptic/workspace.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/fixed_vector.h"
#include "idl/types/messages.h"

namespace tenon {

/// What changed for a hand in one millisecond that somebody should be told.
struct HandNews {
  FixedVector<Intervention, 8> interventions;  ///< of the safety layer
  bool fault_began = false;
  bool indexing_began = false;
  bool indexing_ended = false;
  bool stale_began = false;
  bool beyond_validity_began = false;
};

/// One hand's kilohertz: device in, local model, coupling, safety, device out; and what the server and the
/// others are told of it.
///
/// Every force goes through the device's safety layer (devices/safety.h), whose slew limit lets a force grow
/// slowly and fall at once.
///
/// Threads: one. Real-time: step, receive.
class HapticHand {
 public:
  /// Numbers of workspace and coupling come from the device. `device` outlives the hand.
  /// `clutch` is shared by the arms of one machine; null for a device of its own.
  explicit HapticHand(HapticDevice& device, ClutchLatch* clutch = nullptr);

  /// Forces on, and the workspace so that the hand is at p_WH now.
  Result<void> begin(HandId hand, ClientId client, const Vector3& p_WH);
  void receive(const HandManifold& manifold) noexcept { local_.receive(manifold); }
  void step(std::uint32_t seq, const WorldView& world, double dt) noexcept;
  /// Emergency stop: forces off and the object stays, latched until an operator releases it.
  void stop(bool engaged) noexcept;
  void end() noexcept { device_.disarm(); }

  [[nodiscard]] HandId id() const noexcept { return input_.hand; }
  [[nodiscard]] const DeviceInput& input() const noexcept { return input_; }
  [[nodiscard]] const HandState& state() const noexcept { return state_; }
  [[nodiscard]] const HandNews& news() const noexcept { return news_; }
  [[nodiscard]] const DeviceState& device() const noexcept { return device_state_; }
  [[nodiscard]] const DeviceCaps& caps() const noexcept { return device_.caps(); }
  [[nodiscard]] Workspace& workspace() noexcept { return workspace_; }
  [[nodiscard]] const LocalModel& local() const noexcept { return local_; }
  [[nodiscard]] const Pose& pose() const noexcept { return input_.samples[0].X_WH; }
  [[nodiscard]] bool inContact() const noexcept { return in_contact_; }

 private:
  void sendOn(std::uint32_t seq, const WorldView& world, const Twist& V_WH) noexcept;
  void notice() noexcept;

  HapticDevice& device_;
  Workspace workspace_;
  LocalModel local_;
  Coupling coupling_;
  Safety safety_;
  DeviceState device_state_;
  DeviceInput input_;
  HandState state_;
  HandNews news_;
  std::uint64_t beyond_before_ = 0;
  bool fault_before_ = false;
  bool beyond_ = false;
  bool stale_ = false;
  bool in_contact_ = false;
  bool stopped_ = false;
};

}  // namespace tenon
