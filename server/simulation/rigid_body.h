#pragma once

#include <memory>

#include "idl/types/spatial.h"
#include "server/simulation/scene.h"

namespace tenon::simulation {

/// Velocity integration of a free rigid body by Bullet's btRigidBody, in double precision: gravity, an
/// applied wrench, and the gyroscopic moment (implicit, so that an elongated body does not gain energy).
/// Poses and contacts are the island solver's: Bullet gets the current orientation and does no collision
/// detection. Only operations whose results are equal on every processor are used.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class RigidBody {
 public:
  RigidBody(const BodySpec& spec, const Vector3& gravity_W);
  ~RigidBody();
  RigidBody(RigidBody&&) noexcept;
  RigidBody& operator=(RigidBody&&) noexcept;

  /// Advances the velocities by one tick: the twist of the centre of mass C at the end of the tick, in W, for
  /// the twist `V_WC` at its start and the wrench `F_Co_W` about C (gravity is added).
  [[nodiscard]] Twist integrateVelocity(const Quaternion& q_WO, const Twist& V_WC,
                                        const Wrench& F_Co_W) noexcept;
  /// [kg m^2] about C, in W, at the orientation `q_WO`.
  [[nodiscard]] Matrix3 inertia(const Quaternion& q_WO) const noexcept;
  [[nodiscard]] double mass() const noexcept { return spec_.mass; }  ///< [kg]
  /// [m] p_OC_O, the centre of mass in the body's frame.
  [[nodiscard]] const Vector3& centre() const noexcept { return spec_.p_OC_O; }
  /// [N] force of gravity in W; zero for a floating body.
  [[nodiscard]] const Vector3& weight() const noexcept { return weight_W_; }
  /// [J] kinetic energy.
  [[nodiscard]] double energy(const Quaternion& q_WO, const Twist& V_WC) const noexcept;

 private:
  struct Bullet;

  BodySpec spec_;
  Quaternion q_OP_ = Quaternion::Identity();  // P: principal axes of inertia
  Vector3 weight_W_ = Vector3::Zero();
  std::unique_ptr<Bullet> bullet_;
};

/// Twist of a point C of the body from the twist of the body's origin O; and back. All in W.
[[nodiscard]] Twist atCentre(const Twist& V_WO, const Pose& X_WO, const Vector3& p_OC_O);
[[nodiscard]] Twist atOrigin(const Twist& V_WC, const Pose& X_WO, const Vector3& p_OC_O);

}  // namespace tenon::simulation
