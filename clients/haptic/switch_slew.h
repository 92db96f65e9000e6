#pragma once

#include <algorithm>

#include "devices/safety_rules.h"
#include "idl/types/spatial.h"

namespace tenon::haptic {

/// Between two force models: the wrench goes from where it was to what the new model says, so no switch is a
/// jolt, and none needs the force to stop. What both have in common stays, the rest of the old one leaves by
/// kForceFall and kTorqueFall, and until the wrench is the new model's it grows at most as one that starts
/// (SafetyLimits::start_force_slew).
///
/// Threads: one. Real-time: everything.
class SwitchSlew {
 public:
  static constexpr double kForceFall = 2000.0;  ///< [N/s]
  static constexpr double kTorqueFall = 200.0;  ///< [Nm/s]

  explicit SwitchSlew(const devices::SafetyLimits& limits)
      : force_growth_(limits.start_force_slew), torque_growth_(limits.start_torque_slew) {}
  /// The next wrench is of another model.
  void begin() noexcept { begins_ = true; }
  /// The force has stopped: nothing is left of an earlier model.
  void reset() noexcept { common_ = leaving_ = {}, begins_ = is_under_way_ = false; }
  /// One cycle of `dt` [s]: the wrench to render for that of the model.
  Wrench step(const Wrench& F_Ho_W, double dt) noexcept {
    if (begins_) {
      const Wrench rendered = common_ + leaving_;
      common_ = grown(rendered, F_Ho_W, 0.0);
      leaving_ = rendered + -common_;
      is_under_way_ = true;
    }
    begins_ = false;
    if (!is_under_way_) {
      common_ = F_Ho_W;
      leaving_ = {};
      return F_Ho_W;
    }
    common_ = grown(common_, F_Ho_W, dt);
    leaving_.force = clampNorm(leaving_.force, std::max(0.0, leaving_.force.norm() - kForceFall * dt));
    leaving_.torque = clampNorm(leaving_.torque, std::max(0.0, leaving_.torque.norm() - kTorqueFall * dt));
    const Wrench left = leaving_ + common_ + -F_Ho_W;
    is_under_way_ = left.force.norm() > kEqual || left.torque.norm() > kEqual;
    return common_ + leaving_;
  }

 private:
  static constexpr double kEqual = 1e-9;  // [N, Nm]
  /// After `dt` [s].
  [[nodiscard]] Wrench grown(const Wrench& from, const Wrench& to, double dt) const noexcept {
    return {devices::slewLimited(from.force, to.force, force_growth_ * dt),
            devices::slewLimited(from.torque, to.torque, torque_growth_ * dt)};
  }

  double force_growth_;   // [N/s]
  double torque_growth_;  // [Nm/s]
  Wrench common_;         // of what is rendered, along the model's
  Wrench leaving_;        // of the model before
  bool begins_ = false;
  bool is_under_way_ = false;
};

}  // namespace tenon::haptic
