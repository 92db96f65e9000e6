#pragma once

#include <cstdint>
#include <memory>

#include "devices/device.h"
#include "devices/simulated/simulated_device.h"

namespace tenon::devices {

/// One arm of the HUG.
///
/// Threads: any. Real-time: no.
[[nodiscard]] SimulatedModel hugArmModel();

/// Bimanual haptic device HUG of DLR: two light-weight robots behind the person, one for each hand.
///
/// Each hand is coupled by a magnetic clutch, which opens above 80 N in any direction; then both robots stop
/// where they are and both hands are released. resetFault() closes the clutch and couples the hand to the
/// handle again; each arm has to be armed afterwards.
///
/// Threads: both arms from one servo thread. Real-time: as HapticDevice.
class Hug : public BimanualDevice {
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

}  // namespace tenon::devices
