#pragma once

#include <algorithm>

#include "idl/types/spatial.h"

namespace tenon::haptic {

/// Between two force models: the wrench continues from where it was, and what the new model says otherwise
/// comes at kForceSlew and kTorqueSlew at most. So no switch is a jolt, and none needs the force to stop.
///
/// Threads: one. Real-time: everything.
class SwitchSlew {
 public:
  static constexpr double kForceSlew = 2000.0;  ///< [N/s]
  static constexpr double kTorqueSlew = 200.0;  ///< [Nm/s]

  /// The next wrench is of another model.
  void begin() noexcept { begins_ = true; }
  /// The force has stopped: nothing is left of an earlier model.
  void reset() noexcept { offset_ = last_ = {}, begins_ = false; }
  /// One cycle of `dt` [s]: the wrench to render for that of the model.
  Wrench step(const Wrench& F_Ho_W, double dt) noexcept {
    if (begins_) offset_ = last_ + -F_Ho_W;
    begins_ = false;
    offset_.force = clampNorm(offset_.force, std::max(0.0, offset_.force.norm() - kForceSlew * dt));
    offset_.torque = clampNorm(offset_.torque, std::max(0.0, offset_.torque.norm() - kTorqueSlew * dt));
    last_ = F_Ho_W + offset_;
    return last_;
  }

 private:
  Wrench last_;    // rendered
  Wrench offset_;  // on the newest model's, that is left of the others
  bool begins_ = false;
};

}  // namespace tenon::haptic
