#pragma once

#include <memory>
#include <utility>

#include "devices/device.h"

namespace tenon::devices {

/// A device that is mounted turned: converts between its own frame M and D (DeviceConfiguration::q_DM). The
/// hand's frame is parallel to D where the device has no rotation.
///
/// Threads, Real-time: as HapticDevice.
class MountedDevice final : public HapticDevice {
 public:
  /// Owns `device`.
  MountedDevice(std::unique_ptr<HapticDevice> device, const Quaternion& q_DM)
      : owned_(std::move(device)), device_(*owned_), q_DM_(q_DM) {}
  /// `device` outlives it.
  MountedDevice(HapticDevice& device, const Quaternion& q_DM) : device_(device), q_DM_(q_DM) {}

  [[nodiscard]] const DeviceCaps& caps() const override { return device_.caps(); }
  [[nodiscard]] Result<void> arm() override { return device_.arm(); }
  void disarm() noexcept override { device_.disarm(); }
  [[nodiscard]] Result<void> resetFault() override { return device_.resetFault(); }
  [[nodiscard]] bool paces() const noexcept override { return device_.paces(); }
  [[nodiscard]] bool awaitReading(std::chrono::nanoseconds longest) noexcept override {
    return device_.awaitReading(longest);
  }
  void read(DeviceState& state) noexcept override {
    device_.read(state);
    state.X_DH = Pose(q_DM_ * state.X_DH.translation(), q_DM_ * state.X_DH.rotation() * q_DM_.conjugate());
    state.V_DH = {q_DM_ * state.V_DH.linear, q_DM_ * state.V_DH.angular};
    state.F_Ho_D_measured = {q_DM_ * state.F_Ho_D_measured.force, q_DM_ * state.F_Ho_D_measured.torque};
  }
  void write(const DeviceCommand& command) noexcept override {
    DeviceCommand turned = command;
    turned.F_Ho_D = {q_DM_.conjugate() * command.F_Ho_D.force, q_DM_.conjugate() * command.F_Ho_D.torque};
    device_.write(turned);
  }
  void show(const HandView& view) noexcept override {
    HandView turned = view;
    const Pose X_MD(Vector3::Zero(), q_DM_.conjugate());
    turned.X_DS = X_MD * view.X_DS * X_MD.inverse();
    turned.X_DO = X_MD * view.X_DO * X_MD.inverse();
    device_.show(turned);
  }
  [[nodiscard]] HapticDevice& inner() noexcept override { return device_.inner(); }

 private:
  std::unique_ptr<HapticDevice> owned_;
  HapticDevice& device_;
  Quaternion q_DM_;
};

/// Likewise, both arms.
///
/// Threads, Real-time: as HapticDevice.
class MountedBimanualDevice final : public BimanualDevice {
 public:
  MountedBimanualDevice(std::unique_ptr<BimanualDevice> device, const Quaternion& q_DM)
      : device_(std::move(device)), right_(device_->right(), q_DM), left_(device_->left(), q_DM) {}
  [[nodiscard]] HapticDevice& right() override { return right_; }
  [[nodiscard]] HapticDevice& left() override { return left_; }

 private:
  std::unique_ptr<BimanualDevice> device_;
  MountedDevice right_;
  MountedDevice left_;
};

}  // namespace tenon::devices
