#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tenon {

using Vector3 = Eigen::Vector3d;
using Vector3f = Eigen::Vector3f;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

/// A vector in the direction of `v` with a norm of at most `limit` [unit of v] >= 0; zero stays zero, NaN
/// stays NaN.
[[nodiscard]] inline Vector3 clampNorm(const Vector3& v, double limit) {
  const double norm = v.norm();
  return norm > limit ? Vector3(v * (limit / norm)) : v;
}

/// [rad] atan2(y, x) of `y` [-] >= 0 and `x` [-], in 0..pi; 0 for y = x = 0. Computed with + - * / and sqrt
/// alone, so that it has the same bits on every processor; std::atan2 has not.
[[nodiscard]] double angleOf(double y, double x);

/// Rotation by the angle |w| <= pi [rad] about w (exponential map of SO(3)); same bits on every processor.
[[nodiscard]] Quaternion expRotation(const Vector3& w);

/// Rotation vector w [rad], |w| <= pi, of the unit quaternion q: inverse of expRotation; same bits
/// everywhere.
[[nodiscard]] Vector3 logRotation(const Quaternion& q);

/// A rigid transform X_AB: the pose of frame B in frame A. p_AP = X_AB * p_BP; X_AC = X_AB * X_BC.
class Pose {
 public:
  Pose() : translation_(Vector3::Zero()), rotation_(Quaternion::Identity()) {}
  Pose(const Vector3& p_AB_A, const Quaternion& q_AB) : translation_(p_AB_A), rotation_(q_AB) {}
  explicit Pose(const Vector3& p_AB_A) : translation_(p_AB_A), rotation_(Quaternion::Identity()) {}

  [[nodiscard]] static Pose Identity() { return {}; }

  [[nodiscard]] const Vector3& translation() const { return translation_; }
  [[nodiscard]] Vector3& translation() { return translation_; }
  /// Unit quaternion q_AB; writers must keep it normalised.
  [[nodiscard]] const Quaternion& rotation() const { return rotation_; }
  [[nodiscard]] Quaternion& rotation() { return rotation_; }
  [[nodiscard]] Matrix3 matrix() const { return rotation_.toRotationMatrix(); }

  [[nodiscard]] Pose inverse() const {
    const Quaternion q_BA = rotation_.conjugate();
    return {-(q_BA * translation_), q_BA};
  }
  [[nodiscard]] Vector3 operator*(const Vector3& p_BP) const { return translation_ + rotation_ * p_BP; }
  [[nodiscard]] Pose operator*(const Pose& X_BC) const {
    return {*this * X_BC.translation_, (rotation_ * X_BC.rotation_).normalized()};
  }
  [[nodiscard]] bool isFinite() const { return translation_.allFinite() && rotation_.coeffs().allFinite(); }
  [[nodiscard]] bool operator==(const Pose& other) const {
    return translation_ == other.translation_ && rotation_.coeffs() == other.rotation_.coeffs();
  }

 private:
  Vector3 translation_;
  Quaternion rotation_;
};

/// Velocity of a body; the variable's name has the frames, V_WO: of O relative to and expressed in W.
struct Twist {
  Vector3 linear = Vector3::Zero();   ///< [m/s] of the body's origin
  Vector3 angular = Vector3::Zero();  ///< [rad/s]
};

/// Force and torque on a body; the variable's name has point and frame, F_Bo_W: on B about its origin, in W.
struct Wrench {
  Vector3 force = Vector3::Zero();   ///< [N]
  Vector3 torque = Vector3::Zero();  ///< [Nm]

  Wrench& operator+=(const Wrench& other) {
    force += other.force;
    torque += other.torque;
    return *this;
  }
  [[nodiscard]] Wrench operator+(const Wrench& other) const { return Wrench(*this) += other; }
  [[nodiscard]] Wrench operator-() const { return {-force, -torque}; }
  /// `scale` [-].
  [[nodiscard]] Wrench operator*(double scale) const { return {force * scale, torque * scale}; }
};

/// The motion from pose X_WA to X_WB, in W.
struct Displacement {
  Vector3 translation = Vector3::Zero();  ///< [m] of the origin, p_AB_W; or of another point of the body
  Vector3 rotation = Vector3::Zero();     ///< [rad] rotation vector of R_WB R_WA^T, length <= pi
};

/// [m] Upper bound of the path length of any point of a body within `radius` [m] of the point that
/// `motion.translation` is of, for a motion with constant velocity and angular velocity.
[[nodiscard]] inline double maxPointMotion(const Displacement& motion, double radius) {
  return motion.translation.norm() + motion.rotation.norm() * radius;
}

/// The displacement from A to B.
[[nodiscard]] Displacement displacement(const Pose& X_WA, const Pose& X_WB);
/// The same with the translation of the point Q, fixed at p_OQ_O [m] in the frame O that moves from A to B.
[[nodiscard]] Displacement displacement(const Pose& X_WA, const Pose& X_WB, const Vector3& p_OQ_O);
/// X_WB for displacement(X_WA, X_WB): the inverse of displacement().
[[nodiscard]] Pose displaced(const Pose& X_WA, const Displacement& motion_W);
/// The same for the displacement of the point Q: its inverse.
[[nodiscard]] Pose displaced(const Pose& X_WA, const Displacement& motion_W, const Vector3& p_OQ_O);

}  // namespace tenon
