#pragma once

#include <memory>
#include <utility>

#include "devices/device.h"

namespace tenon::test {

/// A device whose readings can stop although it reports no fault.
class QuietDevice final : public devices::HapticDevice {
 public:
  explicit QuietDevice(std::unique_ptr<devices::HapticDevice> device) : device_(std::move(device)) {}

  [[nodiscard]] const devices::DeviceCaps& caps() const override { return device_->caps(); }
  [[nodiscard]] Result<void> arm() override {
    ++arms;
    return device_->arm();
  }
  void disarm() noexcept override { device_->disarm(); }
  [[nodiscard]] Result<void> resetFault() override { return device_->resetFault(); }
  void read(devices::DeviceState& state) noexcept override {
    devices::DeviceState now;
    device_->read(now);
    if (!quiet) last_ = now;
    state = last_;
  }
  void write(const devices::DeviceCommand& command) noexcept override {
    ++writes;
    device_->write(command);
  }
  [[nodiscard]] HapticDevice& inner() noexcept override { return device_->inner(); }

  bool quiet = false;
  int writes = 0, arms = 0;

 private:
  std::unique_ptr<devices::HapticDevice> device_;
  devices::DeviceState last_;
};

}  // namespace tenon::test
