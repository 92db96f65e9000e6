#include "devices/catalog.h"

#include <array>
#include <string>

#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"
#include "devices/simulated/simulated_device.h"
#include "devices/simulated/vibrotac.h"

namespace tenon::devices {
namespace {

using OpenedDevice = Result<std::unique_ptr<HapticDevice>>;
using OpenedBimanual = Result<std::unique_ptr<BimanualDevice>>;

template <SimulatedModel (*kModel)()>
OpenedDevice openSimulated(std::uint64_t seed) {
  auto device = std::make_unique<SimulatedDevice>(kModel(), seed);
  if (auto opened = device->open(); !opened) return fail(opened.error().what);
  return device;
}

OpenedDevice openVibrotac(std::uint64_t /*seed*/) { return std::make_unique<Vibrotac>(); }

OpenedBimanual openHug(std::uint64_t seed) {
  auto hug = std::make_unique<Hug>(seed);
  if (auto opened = hug->open(); !opened) return fail(opened.error().what);
  return hug;
}

template <typename Opened>
struct CatalogEntry {
  std::string_view name;
  Opened (*open)(std::uint64_t seed);
};

constexpr std::array kDevices{
    CatalogEntry<OpenedDevice>{kInstructorDevice, openSimulated<sigma7Model>},
    CatalogEntry<OpenedDevice>{"omega3-sim", openSimulated<omega3Model>},
    CatalogEntry<OpenedDevice>{"falcon-sim", openSimulated<falconModel>},
    CatalogEntry<OpenedDevice>{"vibrotac-sim", openVibrotac},
};

constexpr std::array kBimanualDevices{
    CatalogEntry<OpenedBimanual>{kTraineeDevice, openHug},
};

template <typename Table>
auto findIn(const Table& table, std::string_view name) -> decltype(table.data()) {
  for (const auto& entry : table)
    if (entry.name == name) return &entry;
  return nullptr;
}

template <typename Table>
std::vector<std::string_view> namesIn(const Table& table) {
  std::vector<std::string_view> names;
  for (const auto& entry : table) names.push_back(entry.name);
  return names;
}

template <typename Table>
std::string listOf(const Table& table) {
  std::string list;
  for (const auto& entry : table) list += (list.empty() ? "" : ", ") + std::string(entry.name);
  return list;
}

}  // namespace

Result<void> checkDeviceName(std::string_view name) {
  if (findIn(kDevices, name)) return {};
  if (findIn(kBimanualDevices, name))
    return fail(
        "device '" + std::string(name) +
        "' is bimanual and needs a station with two hands; devices for one hand: " + listOf(kDevices));
  return fail("unknown device '" + std::string(name) + "'; known devices: " + listOf(kDevices) +
              "; bimanual: " + listOf(kBimanualDevices));
}

Result<void> checkBimanualDeviceName(std::string_view name) {
  if (findIn(kBimanualDevices, name)) return {};
  return fail("unknown bimanual device '" + std::string(name) + "'; known: " + listOf(kBimanualDevices));
}

OpenedDevice openDevice(std::string_view name, std::uint64_t seed) {
  if (const auto known = checkDeviceName(name); !known) return fail(known.error().what);
  return findIn(kDevices, name)->open(seed);
}

OpenedBimanual openBimanualDevice(std::string_view name, std::uint64_t seed) {
  if (const auto known = checkBimanualDeviceName(name); !known) return fail(known.error().what);
  return findIn(kBimanualDevices, name)->open(seed);
}

Result<DeviceCaps> capsOf(std::string_view name) {
  if (findIn(kBimanualDevices, name)) {
    const auto device = openBimanualDevice(name);
    return device ? Result<DeviceCaps>((*device)->right().caps()) : fail(device.error().what);
  }
  const auto device = openDevice(name);
  return device ? Result<DeviceCaps>((*device)->caps()) : fail(device.error().what);
}

std::vector<std::string_view> deviceNames() { return namesIn(kDevices); }
std::vector<std::string_view> bimanualDeviceNames() { return namesIn(kBimanualDevices); }

}  // namespace tenon::devices
