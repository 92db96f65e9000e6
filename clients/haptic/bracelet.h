#pragma once

#include <array>
#include <cstdint>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/guarded_device.h"
#include "clients/haptic/tactile_map.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

/// Vibrotactile bracelet on a tracked forearm: contacts become vibrations, which pass the safety layer as
/// forces do. They fade with the age of the contacts, and a stop silences them, as does finish() in one step.
///
/// Threads: as GuardedDevice. Real-time: step, receive, permit, and as GuardedDevice.
class Bracelet : public GuardedDevice {
 public:
  /// `device` outlives it.
  Bracelet(devices::HapticDevice& device, const TactileOptions& options);

  /// Forgets all contacts of `forearm`. `armed` as for HapticHand::begin; it is silent until then.
  void begin(HandId forearm, bool armed);
  void receive(const HandManifold& manifold) noexcept;
  /// As HapticHand's.
  void permit(bool permitted) noexcept;
  /// One cycle, `dt` [s] after the last one; `seq` numbers the forearm's input.
  void step(std::uint32_t seq, double dt) noexcept;
  /// Intensities that were displayed in the last cycle, 0 to 255.
  [[nodiscard]] const TactorIntensities& intensities() const noexcept { return intensities_; }

 private:
  TactileMap map_;
  HandManifold contacts_;
  AnswerAge answers_;
  devices::DeviceState state_;
  TactorIntensities intensities_{};
  bool stopped_ = false;  ///< permit() took the permission
};

}  // namespace tenon::haptic
