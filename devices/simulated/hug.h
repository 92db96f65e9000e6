#pragma once

#include <cstdint>
#include <memory>

#include "devices/device.h"
#include "devices/simulated/simulated_device.h"

namespace tenon {

[[nodiscard]] SimulatedModel hugArmModel();

/// DLR's HUG: two light-weight robots behind the person, one for each hand.
///
/// A magnetic clutch holds each hand. Above 80 N in any direction at either hand it opens and both robots
/// stop where they are; the hands are free. Resetting a fault by the operator closes it, with the hand back
/// at the handle; each arm is then armed again.
///
/// Threads: both arms from one servo thread. Real-time: as HapticDevice.
class Hug : public DevicePair {
 public:
  explicit Hug(std::uint64_t seed = 1);
  [[nodiscard]] Result<void> open();

  [[nodiscard]] SimulatedDevice& right() override { return right_; }
  [[nodiscard]] SimulatedDevice& left() override { return left_; }
  [[nodiscard]] bool clutchOpen() const noexcept { return clutch_->open; }

 private:
  std::shared_ptr<MagneticClutch> clutch_;
  SimulatedDevice right_;
  SimulatedDevice left_;
};

}  // namespace tenon
