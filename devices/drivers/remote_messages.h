#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "devices/device.h"

namespace tenon::devices {

// Messages between a remote hand and the device that it moves; docs/devices.md has their layout. A change of
// it is a new version.
inline constexpr std::uint32_t kRemoteMagic = 0x444E4854;  ///< [-] "THND" as bytes
inline constexpr std::uint16_t kRemoteVersion = 1;         ///< [-]
inline constexpr std::size_t kRemoteTargetSize = 80;       ///< [bytes]
inline constexpr std::size_t kRemoteViewSize = 272;        ///< [bytes]
inline constexpr double kRemoteReach = 10.0;               ///< [m] of a target from the device's centre

/// Buttons of a remote hand.
enum RemoteButton : std::uint32_t {
  kRemoteMain = 1U << 0U,
  kRemoteArm = 1U << 1U,   ///< its person arms the station, as by the return key
  kRemoteHeld = 1U << 2U,  ///< the dead man's switch
};

/// From the remote hand: where it wants the device.
struct RemoteTarget {
  std::uint32_t seq = 0;
  std::uint32_t buttons = 0;
  Pose X_DT;
  double grip = 0.0;  ///< [m]
};

/// To it, in each cycle: where the device is, and what is displayed.
struct RemoteView {
  std::uint32_t seq = 0;  ///< of the newest target
  bool forces_on = false;
  bool faulty = false;
  std::uint64_t cycle = 0;
  Pose X_DH;
  HandView shown;
  Wrench F_Ho_D;
};

/// Nothing for bytes that are no target: of another size, magic, version or kind, with a number that is not
/// finite, a place beyond kRemoteReach, no unit quaternion (within 1 %) or an opening outside of 0 to 1 m.
/// Threads: any. Real-time: yes.
[[nodiscard]] std::optional<RemoteTarget> decodeTarget(std::span<const std::uint8_t> bytes) noexcept;
[[nodiscard]] std::array<std::uint8_t, kRemoteViewSize> encodeView(const RemoteView& view) noexcept;

}  // namespace tenon::devices
