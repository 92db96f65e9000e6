#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "devices/simulated/simulated_device.h"

namespace tenon::test {

/// A device whose hand moves along a given path whatever the motors do: encoders, delay, motor limits and the
/// hold of one period are those of `model`. What its motors do to that hand is known exactly; of torques they
/// do all that is commanded.
class PathDevice final : public devices::HapticDevice {
 public:
  using Path = std::function<Pose(double)>;  ///< X_DH at a time [s]

  PathDevice(const devices::SimulatedModel& model, Path path) : model_(model), path_(std::move(path)) {}

  [[nodiscard]] const devices::DeviceCaps& caps() const override { return model_.caps; }
  [[nodiscard]] Result<void> arm() override {
    armed_ = true;
    return {};
  }
  void disarm() noexcept override {
    armed_ = false;
    commands_ = {};
  }
  [[nodiscard]] Result<void> resetFault() override { return {}; }
  void read(devices::DeviceState& state) noexcept override {
    if (seq_ > 0) advance();
    ++seq_;
    const Pose X_DH = quantized(path_(now()));
    const Displacement moved = displacement(last_, X_DH);
    if (seq_ > 1) V_DH_ = {moved.translation / kTickSeconds, moved.rotation / kTickSeconds};
    last_ = X_DH;
    state = {};
    state.seq = seq_;
    state.X_DH = X_DH;
    state.V_DH = V_DH_;
    state.forces_on = armed_;
  }
  void write(const devices::DeviceCommand& command) noexcept override {
    if (armed_) newest_ = {motor(command.F_Ho_D.force), command.F_Ho_D.torque};
  }

  /// [s] of the newest reading.
  [[nodiscard]] double now() const { return static_cast<double>(seq_) * kTickSeconds; }
  [[nodiscard]] Pose trueNow() const { return path_(now()); }
  /// Of the motors since the reading before.
  [[nodiscard]] const Wrench& motorWrench() const { return F_Ho_D_; }
  /// [J] given to the hand since the start, and what the damping of the mechanics took from it.
  [[nodiscard]] double given() const { return given_; }
  [[nodiscard]] double damped() const { return damped_; }

 private:
  [[nodiscard]] Vector3 motor(const Vector3& force) const {
    const double quantum = model_.caps.force_quantum;
    return quantum > 0.0 ? devices::quantizeForce(force, quantum) : clampNorm(force, model_.caps.peak_force);
  }
  [[nodiscard]] static Vector3 rounded(const Vector3& v, double step) {
    if (step <= 0.0) return v;
    return (v / step).unaryExpr([](double x) { return std::floor(x + 0.5); }) * step;
  }
  [[nodiscard]] Pose quantized(const Pose& X_DH) const {
    return {rounded(X_DH.translation(), model_.position_resolution),
            expRotation(rounded(logRotation(X_DH.rotation()), model_.angle_resolution))};
  }
  /// Over the period from the newest reading to the next one.
  void advance() {
    commands_[(seq_ + model_.delay) % commands_.size()] = newest_;
    F_Ho_D_ = armed_ ? commands_[seq_ % commands_.size()] : Wrench{};
    constexpr int kSteps = 10;
    for (int i = 0; i < kSteps; ++i) {
      const Displacement path = displacement(path_(now() + i * kTickSeconds / kSteps),
                                             path_(now() + (i + 1) * kTickSeconds / kSteps));
      given_ += F_Ho_D_.force.dot(path.translation) + F_Ho_D_.torque.dot(path.rotation);
      damped_ += (model_.caps.physical_damping * path.translation.squaredNorm() +
                  model_.caps.physical_rotational_damping * path.rotation.squaredNorm()) *
                 kSteps / kTickSeconds;
    }
  }

  devices::SimulatedModel model_;
  Path path_;
  std::uint64_t seq_ = 0;
  bool armed_ = false;
  Pose last_;
  Twist V_DH_;
  Wrench newest_, F_Ho_D_;
  std::array<Wrench, 8> commands_{};
  double given_ = 0.0, damped_ = 0.0;
};

}  // namespace tenon::test
