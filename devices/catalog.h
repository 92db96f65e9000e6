#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "devices/device.h"
#include "devices/tracker.h"

namespace tenon::devices {

/// What stations open unless they are told otherwise; names of the catalog.
inline constexpr std::string_view kTraineeDevice = "hug-sim";
inline constexpr std::string_view kInstructorDevice = "sigma7-sim";
inline constexpr std::string_view kBracelet = "vibrotac-sim";
inline constexpr std::string_view kRemoteHand = "remote";
inline constexpr std::string_view kBodyTracker = "body-sim";

/// Opens a device of the catalog by name; a new device is one line in catalog.cpp. An unknown name fails with
/// a message that lists the known ones, and a serial number that is not there with those that are.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::unique_ptr<HapticDevice>> openDevice(std::string_view name,
                                                               const DeviceConfiguration& configuration = {});
/// Likewise, for a bimanual haptic device.
[[nodiscard]] Result<std::unique_ptr<BimanualDevice>> openBimanualDevice(
    std::string_view name, const DeviceConfiguration& configuration = {});
/// Likewise, for a tracker.
[[nodiscard]] Result<std::unique_ptr<Tracker>> openTracker(std::string_view name,
                                                           const DeviceConfiguration& configuration = {});

/// What the catalog knows of a device without opening it.
struct CatalogFacts {
  unsigned arms = 1;      ///< hands that it moves: 2 of a bimanual one, 0 of one without axes
  bool simulated = true;  ///< with a simulated arm, or without a person
  /// Serial numbers of those that are there; null: such a device has none.
  std::vector<std::string> (*serials)() = nullptr;
};
/// Fails as openDevice does. Threads: any. Real-time: no.
[[nodiscard]] Result<CatalogFacts> findDevice(std::string_view name);
/// Whether the catalog has a tracker of the name; otherwise fails as openTracker does.
[[nodiscard]] Result<void> checkTrackerName(std::string_view name);

/// Capabilities of a device, for one hand or bimanual (those of its right arm). Opens it for that, and fails
/// as openDevice does. Threads: any. Real-time: no.
[[nodiscard]] Result<DeviceCaps> capsOf(std::string_view name);

/// All names of the catalog.
[[nodiscard]] std::vector<std::string_view> deviceNames();
[[nodiscard]] std::vector<std::string_view> bimanualDeviceNames();

}  // namespace tenon::devices
