#pragma once

#include <cstdint>

#include "clients/haptic/local_model.h"
#include "idl/types/spatial.h"

namespace tenon::haptic {

struct CouplingOptions {
  double max_stiffness = 1000.0;           ///< [N/m] renderable by the device
  double max_rotational_stiffness = 20.0;  ///< [Nm/rad] likewise
  double damping = 0.0;                    ///< [Ns/m] at full stiffness
  double rotational_damping = 0.0;         ///< [Nms/rad] likewise
  std::uint32_t dof_mask = 0x3F;           ///< actuated axes of the device; the others get 0
};

/// Virtual coupling between device pose D (here X_WH) and proxy pose S: F = K (S - D) + B (V_S - V_D), on the
/// hand.
///
/// K is the server's, capped at max_stiffness. V_S - V_D is the filtered rate of S - D instead of a
/// difference of velocities, so in free motion, where S equals D, the force is zero whatever the device's
/// velocity estimate. What follows a discontinuity of the proxy is for HapticHand to decide.
///
/// Threads: one. Real-time: everything.
class Coupling {
 public:
  explicit Coupling(const CouplingOptions& options) : options_(options) {}

  /// One cycle of `dt` [s]: the wrench on the hand about its origin, in W.
  Wrench step(const LocalProxy& proxy, const Pose& X_WH, double dt) noexcept;
  void reset() noexcept;
  /// [N/m] used in the last step, for the safety layer.
  [[nodiscard]] double stiffness() const noexcept { return stiffness_; }
  /// [Nm/rad] likewise.
  [[nodiscard]] double rotationalStiffness() const noexcept { return rotational_stiffness_; }

 private:
  CouplingOptions options_;
  Displacement stretch_;               // from D to S, in W
  Displacement stretch_rate_;          // low-pass filtered
  double stiffness_ = 0.0;             // [N/m]
  double rotational_stiffness_ = 0.0;  // [Nm/rad]
  bool has_stretch_ = false;
};

}  // namespace tenon::haptic
