#pragma once

#include <memory>
#include <string>
#include <vector>

#include "devices/catalog.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/result.h"

namespace tenon::station {

struct StationDevice {
  std::string name;  ///< in the catalog, with one arm or two
  devices::DeviceConfiguration configuration;
  /// One arm that is not of the catalog, moved by its owner; null: it is.
  std::shared_ptr<devices::HapticDevice> opened;
};

struct StationArm {
  devices::HapticDevice* device = nullptr;
  devices::ClutchLatch* clutch = nullptr;  ///< that it shares with the other arms of its device
  Quaternion q_DM;                         ///< of its mounting
};

/// The open devices of a station, and their arms in the order of their hands, of two arms the right one
/// first.
///
/// Threads: one. Real-time: no.
class StationArms {
 public:
  /// Two devices of a kind are two: one whose serial number nobody says is the first one that is there and
  /// not another one's. `by_owner`: nobody but who holds them moves the devices. Fails with a sentence when a
  /// device is unknown, cannot be opened, or cannot be moved otherwise.
  [[nodiscard]] Result<void> open(std::vector<StationDevice> all, bool by_owner);
  [[nodiscard]] const std::vector<StationArm>& all() const { return arms_; }

 private:
  /// Of the catalog; its arms share a clutch.
  struct OpenDevice {
    std::unique_ptr<devices::HapticDevice> one;
    std::unique_ptr<devices::BimanualDevice> pair;
    std::unique_ptr<devices::ClutchLatch> clutch = std::make_unique<devices::ClutchLatch>();
  };
  [[nodiscard]] Result<void> openOne(const StationDevice& device, bool by_owner);
  void add(OpenDevice device, const Quaternion& q_DM);

  std::vector<OpenDevice> devices_;
  std::vector<StationArm> arms_;
};

}  // namespace tenon::station
