#pragma once

#include <cstdint>

#include "idl/types/messages/hands.h"
#include "idl/types/spatial.h"

namespace tenon::haptic {

/// What a device allows a virtual fixture.
struct FixtureLimits {
  double stiffness = 0.0;             ///< [N/m]
  double rotational_stiffness = 0.0;  ///< [Nm/rad]
  double damping = 0.0;               ///< [Ns/m]
  double force = 0.0;                 ///< [N]
  double torque = 0.0;                ///< [Nm]
};

/// Virtual fixture that guides one hand: a spring and a damper between the hand and an anchor.
///
/// Of a fixture that leads, the anchor starts at the hand, follows it where the fixture leaves it free, and
/// moves to the fixture no faster than the force may grow. Where the force is at its limit the hand drags the
/// anchor along. So an instructor who jumps or a trainee who holds against it meets a bounded force, and a
/// hand that is let go of is not thrown. Of a fixture that resists, the spring is stretched from where the
/// hand was nearest to the fixture.
///
/// The limit rises from zero when a fixture begins and falls to zero when it is off, another one is chosen,
/// or its messages are too old. Beside the motion of the anchor no energy comes from any of this: the spring
/// is conservative, and whatever drags or shortens it takes energy (virtual_fixture_test).
///
/// Threads: one. Real-time: everything.
class VirtualFixture {
 public:
  static constexpr double kForce = 6.0;        ///< [N] largest, where the device allows it [assumed]
  static constexpr double kTorque = 0.2;       ///< [Nm] likewise
  static constexpr double kGrowth = 20.0;      ///< [N/s] as of a force that starts (devices::SafetyLimits)
  static constexpr double kStiffness = 300.0;  ///< [N/m] largest
  static constexpr double kStaleAt = 0.100;    ///< [s] without a message: the fixture ends
  static constexpr double kRamp = kForce / kGrowth;  ///< [s] in which its limit rises or falls

  explicit VirtualFixture(const FixtureLimits& limits);

  /// Older ticks and server epochs are ignored; implausible values switch the fixture off.
  void receive(const Guidance& guidance) noexcept;
  /// One cycle of `dt` [s] with the hand at X_WH; `permitted`: otherwise the fixture ends. The wrench on the
  /// hand about its origin, in W.
  Wrench step(const Pose& X_WH, double dt, bool permitted) noexcept;
  /// No force at once; a fixture that is still there begins anew.
  void restart() noexcept;

  /// The fixture has a force, or would have one away from where it leads.
  [[nodiscard]] bool acts() const noexcept { return share_ > 0.0; }
  /// [N/m] of the last step, for the safety layer: rises and falls with the limit, since the layer scales the
  /// forces of contacts, too, where both springs together are stiffer than the device allows.
  [[nodiscard]] double stiffness() const noexcept { return share_ * stiffness_; }
  /// [Nm/rad] likewise.
  [[nodiscard]] double rotationalStiffness() const noexcept { return share_ * rotational_stiffness_; }
  /// [N] of the last step.
  [[nodiscard]] double force() const noexcept { return force_; }
  /// The fixture of the last step.
  [[nodiscard]] const Guidance& guidance() const noexcept { return current_; }

 private:
  /// Begins newest_, which is fresh, at X_WH.
  void begin(const Pose& X_WH) noexcept;
  /// [N] towards the anchor, which moves by up to `moved` [m]; `p_HF_W` [m] from the hand to the fixture
  /// where it does not leave the hand free.
  [[nodiscard]] Vector3 lead(const Vector3& p_WH, const Vector3& p_HF_W, double moved) noexcept;
  /// [N] towards the fixture.
  [[nodiscard]] Vector3 resist(const Vector3& p_HF_W) noexcept;
  /// [Nm] towards the anchor, which turns by up to `turned` [rad].
  [[nodiscard]] Vector3 turn(const Quaternion& q_WH, double turned) noexcept;
  /// The part of v in the directions that the fixture constrains.
  [[nodiscard]] Vector3 constrained(const Vector3& v) const noexcept;
  /// Over `dt` [s].
  void updateVelocity(const Vector3& p_WH, double dt) noexcept;

  FixtureLimits limits_;
  Guidance newest_;
  Guidance current_;
  bool has_newest_ = false;
  double age_ = 0.0;                   ///< [s] of newest_
  double share_ = 0.0;                 ///< [-] of the force limit
  double stiffness_ = 0.0;             ///< [N/m]
  double rotational_stiffness_ = 0.0;  ///< [Nm/rad]
  double force_ = 0.0;                 ///< [N]
  Vector3 p_WF_ = Vector3::Zero();     ///< [m] origin of the fixture, which moves no faster than the anchor
  Vector3 p_WA_ = Vector3::Zero();     ///< [m] anchor
  Quaternion q_WA_ = Quaternion::Identity();
  double nearest_ = 0.0;            ///< [m] from the fixture, of kResist: where its spring is not stretched
  Vector3 p_WH_ = Vector3::Zero();  ///< [m] hand in the last step
  Vector3 v_WH_ = Vector3::Zero();  ///< [m/s] filtered
  bool has_hand_ = false;
};

}  // namespace tenon::haptic
