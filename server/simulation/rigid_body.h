#pragma once

#include <memory>

#include "idl/types/spatial.h"
#include "server/simulation/scene.h"

namespace tenon {

/// The flight of a free body between two ticks: Bullet integrates its velocities under gravity, what else
/// pushes, and the gyroscopic moment (implicitly, so that a long part does not spin itself up). Where the
/// body then is, what it meets and how it turns there are ours: Bullet sees no collision and no pose of its
/// own. In double precision; functions of the C library that differ between processors are kept out.
///
/// Threads: one at a time. Real-time: everything but the constructor.
class RigidBody {
 public:
  RigidBody(const BodySpec& spec, const Vector3& gravity_W);
  ~RigidBody();
  RigidBody(RigidBody&&) noexcept;
  RigidBody& operator=(RigidBody&&) noexcept;

  /// Velocities of the centre of mass and about it, a tick later.
  [[nodiscard]] Twist fly(const Quaternion& q_WO, const Twist& V_WC, const Wrench& F_Co_W) noexcept;
  /// About the centre of mass [kg m^2].
  [[nodiscard]] Matrix3 inertia(const Quaternion& q_WO) const noexcept;
  [[nodiscard]] double mass() const noexcept { return spec_.mass; }
  [[nodiscard]] const Vector3& centre() const noexcept { return spec_.p_OC_O; }
  /// Of gravity on it [N]; none when it floats.
  [[nodiscard]] const Vector3& weight() const noexcept { return weight_W_; }
  /// [J] of motion.
  [[nodiscard]] double energy(const Quaternion& q_WO, const Twist& V_WC) const noexcept;

 private:
  struct Bullet;

  BodySpec spec_;
  Quaternion q_OP_ = Quaternion::Identity();  // P: axes along the principal moments of inertia
  Vector3 weight_W_ = Vector3::Zero();
  std::unique_ptr<Bullet> bullet_;
};

/// Velocity of the centre of mass (and about it), of a body whose frame moves with V_WO; and back.
[[nodiscard]] Twist atCentre(const Twist& V_WO, const Pose& X_WO, const Vector3& p_OC_O);
[[nodiscard]] Twist atOrigin(const Twist& V_WC, const Pose& X_WO, const Vector3& p_OC_O);

}  // namespace tenon
