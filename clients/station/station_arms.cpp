#include "clients/station/station_arms.h"

#include <algorithm>
#include <utility>

#include "devices/mounted_device.h"

namespace tenon::station {

namespace {
Result<void> chooseSerials(std::vector<StationDevice>& all) {
  const auto count = [&](const std::string& name, const std::string& serial) {
    return std::count_if(all.begin(), all.end(), [&](const StationDevice& device) {
      return device.name == name && device.configuration.serial == serial;
    });
  };
  for (StationDevice& device : all) {
    std::string& serial = device.configuration.serial;
    if (!serial.empty() && count(device.name, serial) > 1)
      return fail("device '" + device.name + "' with serial number " + serial + " is given twice");
    const auto facts = devices::findDevice(device.name);
    if (!serial.empty() || device.opened || !facts || facts->serials == nullptr) continue;
    const std::vector<std::string> there = facts->serials();
    const auto free = std::find_if(there.begin(), there.end(),
                                   [&](const std::string& one) { return count(device.name, one) == 0; });
    if (free == there.end())
      return fail("device '" + device.name + "': " + std::to_string(there.size()) +
                  " are there, and one more is asked for");
    serial = *free;
  }
  return {};
}
}  // namespace

Result<void> StationArms::open(std::vector<StationDevice> all, bool by_owner) {
  if (auto chosen = chooseSerials(all); !chosen) return chosen;
  for (const StationDevice& device : all)
    if (auto opened = openOne(device, by_owner); !opened) return opened;
  return {};
}

Result<void> StationArms::openOne(const StationDevice& device, bool by_owner) {
  OpenDevice open;
  if (device.opened) {
    open.one = std::make_unique<devices::MountedDevice>(*device.opened, device.configuration.q_DM);
    add(std::move(open), device.configuration.q_DM);
    return {};
  }
  const auto facts = devices::findDevice(device.name);
  if (!facts) return fail(facts.error().what);
  if (facts->arms == 0) return fail("device '" + device.name + "' moves no hand");
  if (!facts->simulated && !by_owner)
    return fail("device '" + device.name + "' is moved by its owner: expected --person none with it");
  if (facts->arms == 2) {
    auto pair = devices::openBimanualDevice(device.name, device.configuration);
    if (!pair) return fail(pair.error().what);
    open.pair = std::move(*pair);
  } else {
    auto one = devices::openDevice(device.name, device.configuration);
    if (!one) return fail(one.error().what);
    open.one = std::move(*one);
  }
  add(std::move(open), device.configuration.q_DM);
  return {};
}

void StationArms::add(OpenDevice device, const Quaternion& q_DM) {
  devices::ClutchLatch* const clutch = device.clutch.get();
  if (device.pair) {
    arms_.push_back({&device.pair->right(), clutch, q_DM});
    arms_.push_back({&device.pair->left(), clutch, q_DM});
  } else {
    arms_.push_back({device.one.get(), clutch, q_DM});
  }
  devices_.push_back(std::move(device));
}

}  // namespace tenon::station
