#include "devices/catalog.h"

#include <array>
#include <memory>
#include <string>
#include <utility>

#include "devices/drivers/remote_device.h"
#include "devices/mounted_device.h"
#include "devices/simulated/body_tracker.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"
#include "devices/simulated/simulated_device.h"
#include "devices/simulated/vibrotac.h"
#include "idl/threads/clock.h"

namespace tenon::devices {
namespace {

using OpenedDevice = Result<std::unique_ptr<HapticDevice>>;
using OpenedBimanual = Result<std::unique_ptr<BimanualDevice>>;
using OpenedTracker = Result<std::unique_ptr<Tracker>>;

std::string serialOf(const DeviceConfiguration& configuration) {
  return configuration.serial.empty() ? simulatedSerials().front() : configuration.serial;
}

void configure(SimulatedDevice& device, const DeviceConfiguration& configuration) {
  device.setSerial(serialOf(configuration));
  if (configuration.dead_man) device.addDeadManSwitch();
  if (configuration.paces) device.addClock(std::make_shared<threads::SteadyClock>(), configuration.seed);
}

template <SimulatedModel (*kModel)()>
OpenedDevice openSimulated(const DeviceConfiguration& configuration) {
  auto device =
      std::make_unique<SimulatedDevice>(kModel(), unitSeed(configuration.seed, configuration.serial));
  configure(*device, configuration);
  if (auto opened = device->open(); !opened) return fail(opened.error().what);
  return device;
}

OpenedDevice openVibrotac(const DeviceConfiguration& configuration) {
  return std::make_unique<Vibrotac>(serialOf(configuration));
}

OpenedBimanual openHug(const DeviceConfiguration& configuration) {
  auto hug = std::make_unique<Hug>(unitSeed(configuration.seed, configuration.serial));
  configure(hug->right(), configuration);
  configure(hug->left(), configuration);
  if (auto opened = hug->open(); !opened) return fail(opened.error().what);
  return hug;
}

OpenedDevice openRemote(const DeviceConfiguration& configuration) {
  auto device = RemoteDevice::open(configuration.address);
  if (!device) return fail(device.error().what);
  return std::move(*device);
}

OpenedTracker openBodyTracker(const DeviceConfiguration& /*configuration*/) {
  return std::make_unique<BodyTracker>();
}

template <typename Opened>
struct CatalogEntry {
  std::string_view name;
  Opened (*open)(const DeviceConfiguration& configuration);
  CatalogFacts facts{.serials = simulatedSerials};
};

constexpr std::array kDevices{
    CatalogEntry<OpenedDevice>{kInstructorDevice, openSimulated<sigma7Model>},
    CatalogEntry<OpenedDevice>{"omega3-sim", openSimulated<omega3Model>},
    CatalogEntry<OpenedDevice>{"falcon-sim", openSimulated<falconModel>},
    CatalogEntry<OpenedDevice>{kBracelet, openVibrotac, {.arms = 0, .serials = simulatedSerials}},
    CatalogEntry<OpenedDevice>{kRemoteHand, openRemote, {.simulated = false}},
};

constexpr std::array kBimanualDevices{
    CatalogEntry<OpenedBimanual>{kTraineeDevice, openHug, {.arms = 2, .serials = simulatedSerials}},
};

constexpr std::array kTrackers{
    CatalogEntry<OpenedTracker>{kBodyTracker, openBodyTracker},
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

std::string unknown(std::string_view name) {
  return "unknown device '" + std::string(name) + "'; known devices: " + listOf(kDevices) +
         "; bimanual: " + listOf(kBimanualDevices);
}

Result<void> checkSerial(const CatalogFacts& facts, std::string_view name, const std::string& serial) {
  if (serial.empty()) return {};
  const std::string device = "device '" + std::string(name) + "'";
  if (facts.serials == nullptr) return fail(device + ": has no serial number, so none can be asked for");
  std::string there;
  for (const std::string& known : facts.serials()) {
    if (known == serial) return {};
    there += (there.empty() ? "" : ", ") + known;
  }
  return fail(device + ": none with serial number '" + serial +
              "' is there; there are: " + (there.empty() ? "none" : there));
}

bool isTurned(const DeviceConfiguration& configuration) {
  return !configuration.q_DM.isApprox(Quaternion::Identity());
}

}  // namespace

Result<CatalogFacts> findDevice(std::string_view name) {
  if (const auto* const one = findIn(kDevices, name)) return one->facts;
  if (const auto* const pair = findIn(kBimanualDevices, name)) return pair->facts;
  return fail(unknown(name));
}

Result<void> checkTrackerName(std::string_view name) {
  if (findIn(kTrackers, name)) return {};
  return fail("unknown tracker '" + std::string(name) + "'; known trackers: " + listOf(kTrackers));
}

OpenedDevice openDevice(std::string_view name, const DeviceConfiguration& configuration) {
  const auto* const entry = findIn(kDevices, name);
  if (entry == nullptr && findIn(kBimanualDevices, name))
    return fail(
        "device '" + std::string(name) +
        "' is bimanual and needs a station with two hands; devices for one hand: " + listOf(kDevices));
  if (entry == nullptr) return fail(unknown(name));
  if (auto there = checkSerial(entry->facts, name, configuration.serial); !there)
    return fail(there.error().what);
  auto device = entry->open(configuration);
  if (!device || !isTurned(configuration)) return device;
  return std::make_unique<MountedDevice>(std::move(*device), configuration.q_DM);
}

OpenedBimanual openBimanualDevice(std::string_view name, const DeviceConfiguration& configuration) {
  const auto* const entry = findIn(kBimanualDevices, name);
  if (entry == nullptr)
    return fail("unknown bimanual device '" + std::string(name) + "'; known: " + listOf(kBimanualDevices));
  if (auto there = checkSerial(entry->facts, name, configuration.serial); !there)
    return fail(there.error().what);
  auto device = entry->open(configuration);
  if (!device || !isTurned(configuration)) return device;
  return std::make_unique<MountedBimanualDevice>(std::move(*device), configuration.q_DM);
}

OpenedTracker openTracker(std::string_view name, const DeviceConfiguration& configuration) {
  if (const auto known = checkTrackerName(name); !known) return fail(known.error().what);
  return findIn(kTrackers, name)->open(configuration);
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
