#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "devices/device.h"

namespace tenon::devices {

/// What stations open unless they are told otherwise; names of the catalog.
inline constexpr std::string_view kTraineeDevice = "hug-sim";
inline constexpr std::string_view kInstructorDevice = "sigma7-sim";

/// Opens a device of the catalog by name; a new device is one line in catalog.cpp. An unknown name fails with
/// a message that lists the known ones. `seed` varies the parameters of a simulated device; a real device
/// ignores it.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::unique_ptr<HapticDevice>> openDevice(std::string_view name, std::uint64_t seed = 1);
/// Likewise, for a bimanual haptic device.
[[nodiscard]] Result<std::unique_ptr<BimanualDevice>> openBimanualDevice(std::string_view name,
                                                                         std::uint64_t seed = 1);

/// Whether the catalog has the name; otherwise fails as openDevice and openBimanualDevice do, and opens
/// nothing. Threads: any. Real-time: no.
[[nodiscard]] Result<void> checkDeviceName(std::string_view name);
[[nodiscard]] Result<void> checkBimanualDeviceName(std::string_view name);

/// Capabilities of a device, for one hand or bimanual (those of its right arm). Opens it for that, and fails
/// as openDevice does. Threads: any. Real-time: no.
[[nodiscard]] Result<DeviceCaps> capsOf(std::string_view name);

/// All names of the catalog.
[[nodiscard]] std::vector<std::string_view> deviceNames();
[[nodiscard]] std::vector<std::string_view> bimanualDeviceNames();

}  // namespace tenon::devices
