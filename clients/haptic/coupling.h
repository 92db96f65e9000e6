#pragma once

#include <cstdint>

#include "clients/haptic/local_model.h"
#include "idl/types/spatial.h"

namespace tenon {

struct CouplingOptions {
  double max_stiffness = 1000.0;           ///< [N/m] the device can render
  double max_rotational_stiffness = 20.0;  ///< [Nm/rad]
  double damping = 0.0;                    ///< [Ns/m]
  double rotational_damping = 0.0;         ///< [Nms/rad]
  std::uint32_t dof_mask = 0x3F;           ///< of the device: what it cannot drive is not asked for
  std::uint32_t fade_ticks = 20;           ///< of a force whose cause was declared gone
};

/// The spring and damper between the hand D and the place S its object allows it: F = K (S - D) + B (VS -
/// VD).
///
/// K is the server's, capped by what the device renders stably. VS - VD is the change of S - D itself, so in
/// free motion, where S follows D, nothing is felt whatever the device's velocity estimate says. When the
/// object jumps, the wrench of before fades out in fade_ticks while the new one fades in.
///
/// Threads: one. Real-time: everything.
class Coupling {
 public:
  explicit Coupling(const CouplingOptions& options) : options_(options) {}

  /// The wrench on the hand about its origin, in W.
  Wrench step(const LocalProxy& proxy, const Pose& X_WH, double dt) noexcept;
  void reset() noexcept;
  /// [N/m] in use: for the device's own stability checks.
  [[nodiscard]] double stiffness() const noexcept { return stiffness_; }
  [[nodiscard]] double rotationalStiffness() const noexcept { return rotational_stiffness_; }

 private:
  CouplingOptions options_;
  Displacement stretch_;       // D to S, in W
  Displacement stretch_rate_;  // low-passed
  Wrench displayed_;
  Wrench fading_;  // what was displayed when the object jumped
  double stiffness_ = 0.0;
  double rotational_stiffness_ = 0.0;
  std::uint32_t fade_left_ = 0;
  bool has_stretch_ = false;
};

}  // namespace tenon
