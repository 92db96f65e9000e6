#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "devices/device.h"

namespace tenon {

/// Every device Tenon can open, by name; adding one is a line in catalog.cpp.
/// `seed` makes a simulated specimen; a real device ignores it.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::unique_ptr<HapticDevice>> openDevice(std::string_view name, std::uint64_t seed = 1);
/// A machine with an arm for each hand.
[[nodiscard]] Result<std::unique_ptr<DevicePair>> openPair(std::string_view name, std::uint64_t seed = 1);

/// For --help and for tests that visit them all.
[[nodiscard]] std::vector<std::string_view> deviceNames();
[[nodiscard]] std::vector<std::string_view> pairNames();

}  // namespace tenon
