#pragma once

#include <array>
#include <cstdint>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/device_handover.h"
#include "clients/haptic/tactile_map.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/messages/contacts.h"

namespace tenon::haptic {

/// Vibrotactile bracelet on a tracked forearm: contacts become vibrations, which pass the safety layer as
/// forces do. They fade with the age of the contacts, and a stop silences them.
///
/// Threads: one; armDevice by another one, beside it. Real-time: step, receive, permit.
class Bracelet {
 public:
  /// `device` outlives it.
  Bracelet(devices::HapticDevice& device, const TactileOptions& options);

  /// Forgets all contacts of `forearm`. `armed` as for HapticHand::begin; it is silent until then.
  void begin(HandId forearm, bool armed);
  void receive(const HandManifold& manifold) noexcept;
  /// As HapticHand's.
  void permit(bool permitted) noexcept;
  [[nodiscard]] bool wantsArming() const noexcept { return handover_.pending(); }
  Result<void> armDevice() { return handover_.serve(device_); }
  void handBack() noexcept { handover_.handBack(); }
  /// From the next step on it is silent, and with `disarms` disarmed, until a new begin().
  void finish(bool disarms) noexcept;
  /// Off.
  void end() noexcept { device_.disarm(); }
  /// One cycle, `dt` [s] after the last one; `seq` numbers the forearm's input.
  void step(std::uint32_t seq, double dt) noexcept;
  /// Intensities that were displayed in the last cycle, 0 to 255.
  [[nodiscard]] const TactorIntensities& intensities() const noexcept { return intensities_; }

 private:
  devices::HapticDevice& device_;
  devices::Safety safety_;
  TactileMap map_;
  HandManifold contacts_;
  AnswerAge answers_;
  DeviceHandover handover_;
  TactorIntensities intensities_{};
  bool permitted_ = false;
  bool forces_on_ = false;
  bool finishing_ = false;
  bool finish_disarms_ = false;
};

}  // namespace tenon::haptic
