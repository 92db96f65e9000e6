#pragma once

#include <cstdint>

#include "idl/types/spatial.h"

namespace tenon {

/// A grown-up's arm as the handle feels it. Mass, damping and relaxed stiffness were measured at the hand of
/// people on a HapticMaster (Scientific Reports 8, 2018, srep18004, fig. 3): [published]; the rest is
/// [assumed].
struct HumanArmModel {
  double mass = 0.55;                         ///< [kg] [published]
  double damping = 6.5;                       ///< [Ns/m] [published]
  double stiffness = 135.0;                   ///< [N/m] relaxed [published]
  double stiffness_braced = 500.0;            ///< [N/m] with all muscles tense [assumed]
  double inertia = 2e-3;                      ///< [kgm2] of the hand about the grip [assumed]
  double rotational_damping = 0.06;           ///< [Nms/rad] of the wrist [assumed]
  double rotational_stiffness = 1.5;          ///< [Nm/rad] relaxed [assumed]
  double rotational_stiffness_braced = 15.0;  ///< [Nm/rad] the forearm helps the wrist [assumed]
  double strength = 120.0;                    ///< [N] it can pull at most [assumed]
  double rotational_strength = 5.0;           ///< [Nm] it can twist at most [assumed]
};

/// The impedance of an arm in one moment: what pulls a hand at x towards its intent.
struct ArmImpedance {
  double stiffness = 0.0;
  double damping = 0.0;
};

/// A person's arm: a mass that springs and dampers draw towards where the person wants the hand.
///
/// Where the hand should go is decided elsewhere, by whoever plays the person; here is only flesh. It holds
/// the device's handle firmly, so hand and handle are one body as long as the device holds on
/// (SimulatedDevice moves that body); when a clutch lets go, the hand moves alone. Damping grows with the
/// root of the stiffness, so that a braced arm is as well damped as a relaxed one.
///
/// Threads: the device's servo thread. Real-time: everything.
class HumanArm {
 public:
  explicit HumanArm(const HumanArmModel& model = {}) noexcept;

  /// Where the person wants the hand, and how fast it should be moving there; in the device's frame D.
  void intend(const Pose& X_DI, const Twist& V_DI = {}) noexcept;
  /// Co-contraction: 0 relaxed .. 1 braced.
  void stiffen(double contraction) noexcept;
  void press(std::uint32_t buttons) noexcept { buttons_ = buttons; }

  [[nodiscard]] const HumanArmModel& model() const noexcept { return model_; }
  [[nodiscard]] const Pose& intent() const noexcept { return X_DI_; }
  [[nodiscard]] std::uint32_t buttons() const noexcept { return buttons_; }
  /// Where the hand truly is: finer and fresher than what a device reads.
  [[nodiscard]] const Pose& pose() const noexcept { return X_DH_; }
  [[nodiscard]] const Twist& velocity() const noexcept { return V_DH_; }
  /// What the handle does to the hand, mean of the last millisecond: the force a person feels.
  [[nodiscard]] const Wrench& felt() const noexcept { return F_Ho_D_felt_; }

  // ---- for the device that moves the body of hand and handle
  [[nodiscard]] ArmImpedance impedance() const noexcept;
  [[nodiscard]] ArmImpedance rotationalImpedance() const noexcept;
  /// From the hand at X_DH to the intent, no further than the arm is strong.
  [[nodiscard]] Displacement reach(const Pose& X_DH) const noexcept;
  [[nodiscard]] const Twist& intentVelocity() const noexcept { return V_DI_; }
  void moved(const Pose& X_DH, const Twist& V_DH, const Wrench& F_Ho_D_felt) noexcept;
  /// The hand alone in free air for `dt`.
  void moveFreely(double dt) noexcept;

 private:
  HumanArmModel model_;
  Pose X_DI_;
  Twist V_DI_;
  Pose X_DH_;
  Twist V_DH_;
  Wrench F_Ho_D_felt_;
  double contraction_ = 0.0;
  std::uint32_t buttons_ = 0;
};

}  // namespace tenon
