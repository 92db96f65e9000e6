#pragma once

#include <cstdint>

#include "idl/types/spatial.h"

namespace tenon::devices {

/// Impedance of an adult's arm at the hand. Mass, damping and relaxed stiffness were measured on a
/// HapticMaster (Scientific Reports 8, 2018, srep18004, fig. 3): [published]; the rest is [assumed].
struct HumanArmModel {
  double mass = 0.55;                         ///< [kg] [published]
  double damping = 6.5;                       ///< [Ns/m] [published]
  double stiffness = 135.0;                   ///< [N/m] relaxed [published]
  double stiffness_braced = 500.0;            ///< [N/m] at full co-contraction [assumed]
  double inertia = 2e-3;                      ///< [kgm2] of the hand, about the grip [assumed]
  double rotational_damping = 0.06;           ///< [Nms/rad] of the wrist [assumed]
  double rotational_stiffness = 1.5;          ///< [Nm/rad] relaxed [assumed]
  double rotational_stiffness_braced = 15.0;  ///< [Nm/rad] at full co-contraction, with the forearm [assumed]
  double strength = 120.0;                    ///< [N] largest force of the arm [assumed]
  double rotational_strength = 5.0;           ///< [Nm] largest torque of the wrist [assumed]
};

/// Spring and damper between hand and intended pose, at the present co-contraction.
struct ArmImpedance {
  double stiffness = 0.0;  ///< [N/m] or [Nm/rad]
  double damping = 0.0;    ///< [Ns/m] or [Nms/rad]
};

/// Arm impedance of a person who holds a device: a mass on a spring and damper to the intended hand pose.
///
/// The intended pose comes from a simulated person. Hand and handle are rigidly coupled and SimulatedDevice
/// integrates both as one body; when a clutch opens, the hand moves alone (stepFree). Damping is proportional
/// to the square root of the stiffness, so the damping ratio does not depend on co-contraction.
///
/// Threads: the device's servo thread. Real-time: everything.
class HumanArm {
 public:
  explicit HumanArm(const HumanArmModel& model = {}) noexcept;

  /// Intended pose and velocity of the hand, in the device's frame D.
  void setIntent(const Pose& X_DI, const Twist& V_DI = {}) noexcept;
  /// Co-contraction of the muscles: `contraction` [-] from 0 (relaxed) to 1 (braced), clamped.
  void setContraction(double contraction) noexcept;
  void setButtons(std::uint32_t buttons) noexcept { buttons_ = buttons; }

  [[nodiscard]] const HumanArmModel& model() const noexcept { return model_; }
  [[nodiscard]] std::uint32_t buttons() const noexcept { return buttons_; }
  /// True pose of the hand, without the device's quantisation and delay.
  [[nodiscard]] const Pose& pose() const noexcept { return X_DH_; }
  [[nodiscard]] const Twist& velocity() const noexcept { return V_DH_; }
  /// Wrench of the handle on the hand, about the hand's origin, in D; mean of the last millisecond.
  [[nodiscard]] const Wrench& handleWrench() const noexcept { return F_Ho_D_; }

  // ---- for the device that integrates the body of hand and handle
  [[nodiscard]] ArmImpedance impedance() const noexcept;
  [[nodiscard]] ArmImpedance rotationalImpedance() const noexcept;
  /// Displacement from X_DH to the intended pose, clamped so that the spring does not exceed the arm's
  /// strength.
  [[nodiscard]] Displacement springStretch(const Pose& X_DH) const noexcept;
  [[nodiscard]] const Twist& intentVelocity() const noexcept { return V_DI_; }
  /// State after the device has integrated it.
  void setState(const Pose& X_DH, const Twist& V_DH, const Wrench& F_Ho_D) noexcept;
  /// Semi-implicit step of `dt` [s] of the hand without a handle.
  void stepFree(double dt) noexcept;

 private:
  HumanArmModel model_;
  Pose X_DI_;
  Twist V_DI_;
  Pose X_DH_;
  Twist V_DH_;
  Wrench F_Ho_D_;
  double contraction_ = 0.0;  ///< [-]
  std::uint32_t buttons_ = 0;
};

}  // namespace tenon::devices
