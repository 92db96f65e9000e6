#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "clients/haptic/bracelet.h"
#include "clients/haptic/haptic_hand.h"
#include "clients/haptic/station.h"
#include "clients/haptic/tactile_map.h"
#include "clients/simulated_person/posture.h"
#include "devices/device.h"
#include "devices/tracker.h"
#include "idl/types/messages/hands.h"
#include "idl/types/result.h"

namespace tenon::station {

/// Forearm and head of a station's person: what a tracker sees moves hands of those names, and a bracelet on
/// the forearm vibrates. A simulated tracker sees the posture that follows from the person's hand.
///
/// Threads: as Station. Real-time: step, receive, and as GuardedDevice.
class TrackedPerson {
 public:
  static constexpr std::size_t kBodies = 2;

  /// `tracker` and `tactors` are names of the catalog; no tactors: empty. Fails with a sentence when one
  /// cannot be opened.
  [[nodiscard]] static Result<std::unique_ptr<TrackedPerson>> open(const std::string& tracker,
                                                                   const std::string& tactors,
                                                                   haptic::TactileMode mode,
                                                                   std::uint64_t seed);

  /// Of its hands, in the order of begin().
  [[nodiscard]] static std::array<std::string, kBodies> handNames();
  /// A new seat; `armed` as for HapticHand::begin.
  void begin(std::span<const HandId> hands, ClientId client, bool armed);
  void receive(const HandManifold& manifold) noexcept {
    if (bracelet_) bracelet_->receive(manifold);
  }
  void permit(bool permitted) noexcept {
    if (bracelet_) bracelet_->permit(permitted);
  }
  /// Null: it wears none.
  [[nodiscard]] haptic::GuardedDevice* bracelet() noexcept { return bracelet_ ? &*bracelet_ : nullptr; }
  /// One cycle, `dt` [s] after the last one: `inputs` and `states` of its hands are added. `wearer` is the
  /// hand by which a simulated person stands; null: there is none.
  void step(std::uint32_t seq, double dt, const haptic::HapticHand* wearer, std::uint32_t server_epoch,
            FixedVector<DeviceInput, haptic::kMaxStationHands>& inputs,
            FixedVector<HandState, haptic::kMaxStationHands>& states) noexcept;

 private:
  TrackedPerson() = default;
  void moveSimulated(const haptic::HapticHand& wearer) noexcept;

  std::unique_ptr<devices::Tracker> tracker_;
  std::unique_ptr<devices::HapticDevice> tactors_;
  haptic::TactileOptions tactile_;
  std::array<DeviceInput, kBodies> inputs_{};
  std::optional<haptic::Bracelet> bracelet_;
  simulated_person::Posture posture_{1.0};
};

}  // namespace tenon::station
