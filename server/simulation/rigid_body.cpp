#include "server/simulation/rigid_body.h"

#include <algorithm>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <Eigen/Eigenvalues>

#include "idl/types/ids.h"

namespace tenon::simulation {
namespace {

btVector3 toBullet(const Vector3& v) { return {v.x(), v.y(), v.z()}; }
Vector3 fromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

struct RigidBody::Bullet {
  Bullet(double mass, const Vector3& principal)
      : body(btRigidBody::btRigidBodyConstructionInfo(mass, nullptr, nullptr, toBullet(principal))) {
    body.setFlags(BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
  }
  btRigidBody body;
};

RigidBody::RigidBody(const BodySpec& spec, const Vector3& gravity_W) : spec_(spec) {
  static_assert(sizeof(btScalar) == sizeof(double), "Bullet has to be built in double precision");
  // the iterative decomposition: the closed form uses cos(), which differs between processors
  const Eigen::SelfAdjointEigenSolver<Matrix3> axes(spec.inertia_C_O);
  Matrix3 R_OP = axes.eigenvectors();
  if (R_OP.determinant() < 0.0) R_OP.col(2) = -R_OP.col(2);
  q_OP_ = Quaternion(R_OP).normalized();
  if (!spec.floating) weight_W_ = spec.mass * gravity_W;
  bullet_ = std::make_unique<Bullet>(spec.mass, axes.eigenvalues());
}

RigidBody::~RigidBody() = default;
RigidBody::RigidBody(RigidBody&&) noexcept = default;
RigidBody& RigidBody::operator=(RigidBody&&) noexcept = default;

Twist RigidBody::integrateVelocity(const Quaternion& q_WO, const Twist& V_WC, const Wrench& F_Co_W) noexcept {
  btRigidBody& body = bullet_->body;
  const Quaternion q_WP = q_WO * q_OP_;
  body.setCenterOfMassTransform(btTransform(btQuaternion(q_WP.x(), q_WP.y(), q_WP.z(), q_WP.w())));
  body.setLinearVelocity(toBullet(V_WC.linear));
  body.setAngularVelocity(toBullet(V_WC.angular));
  body.setAngularVelocity(body.getAngularVelocity() +
                          body.computeGyroscopicImpulseImplicit_Body(kTickSeconds));
  body.clearForces();
  body.applyCentralForce(toBullet(weight_W_ + F_Co_W.force));
  body.applyTorque(toBullet(F_Co_W.torque));
  body.integrateVelocities(kTickSeconds);
  // not Bullet's damping: it uses pow(), which differs between processors
  const double damping_factor = std::max(1.0 - spec_.damping * kTickSeconds, 0.0);
  return {damping_factor * fromBullet(body.getLinearVelocity()),
          damping_factor * fromBullet(body.getAngularVelocity())};
}

Matrix3 RigidBody::inertia(const Quaternion& q_WO) const noexcept {
  const Matrix3 R_WO = q_WO.toRotationMatrix();
  return R_WO * spec_.inertia_C_O * R_WO.transpose();
}

double RigidBody::energy(const Quaternion& q_WO, const Twist& V_WC) const noexcept {
  return 0.5 * (spec_.mass * V_WC.linear.squaredNorm() + V_WC.angular.dot(inertia(q_WO) * V_WC.angular));
}

Twist atCentre(const Twist& V_WO, const Pose& X_WO, const Vector3& p_OC_O) {
  return {V_WO.linear + V_WO.angular.cross(X_WO.rotation() * p_OC_O), V_WO.angular};
}

Twist atOrigin(const Twist& V_WC, const Pose& X_WO, const Vector3& p_OC_O) {
  return {V_WC.linear - V_WC.angular.cross(X_WO.rotation() * p_OC_O), V_WC.angular};
}

}  // namespace tenon::simulation
