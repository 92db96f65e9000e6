#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tenon {

using Vector3 = Eigen::Vector3d;
using Vector3f = Eigen::Vector3f;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

/// The angle atan2(y, x) for y >= 0, from +, *, / and sqrt alone: the C library's own may use other
/// instructions on another processor and then give another last bit.
[[nodiscard]] double angleOf(double y, double x);

/// The rotation by |w| about w (exponential map of SO(3)); same bits on every processor.
[[nodiscard]] Quaternion expRotation(const Vector3& w);

/// The rotation vector of q, |w| <= pi (inverse of expRotation); same bits on every processor.
[[nodiscard]] Vector3 logRotation(const Quaternion& q);

/// A rigid transform X_AB: where frame B is, seen from frame A. p_AP = X_AB * p_BP; X_AC = X_AB * X_BC.
class Pose {
 public:
  Pose() : translation_(Vector3::Zero()), rotation_(Quaternion::Identity()) {}
  Pose(const Vector3& p_AB_A, const Quaternion& q_AB) : translation_(p_AB_A), rotation_(q_AB) {}
  explicit Pose(const Vector3& p_AB_A) : translation_(p_AB_A), rotation_(Quaternion::Identity()) {}

  [[nodiscard]] static Pose Identity() { return {}; }

  [[nodiscard]] const Vector3& translation() const { return translation_; }
  [[nodiscard]] Vector3& translation() { return translation_; }
  /// A unit quaternion; whoever sets it keeps it so.
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

/// Velocity of a body: of its origin [m/s] and about it [rad/s], both seen in one frame.
struct Twist {
  Vector3 linear = Vector3::Zero();
  Vector3 angular = Vector3::Zero();
};

/// Force [N] and moment [Nm] on a body, about its origin unless the name says otherwise (F_Bo_W).
struct Wrench {
  Vector3 force = Vector3::Zero();
  Vector3 torque = Vector3::Zero();

  Wrench& operator+=(const Wrench& other) {
    force += other.force;
    torque += other.torque;
    return *this;
  }
  [[nodiscard]] Wrench operator+(const Wrench& other) const { return Wrench(*this) += other; }
  [[nodiscard]] Wrench operator-() const { return {-force, -torque}; }
  [[nodiscard]] Wrench operator*(double scale) const { return {force * scale, torque * scale}; }
};

/// The small motion from pose X_WA to X_WB: translation of the origin and rotation vector, both in W.
struct Displacement {
  Vector3 translation = Vector3::Zero();
  Vector3 rotation = Vector3::Zero();
};

/// [m] The way of the fastest point, at most, of a body that reaches `radius` [m] from its origin.
[[nodiscard]] inline double fastestPoint(const Displacement& motion, double radius) {
  return motion.translation.norm() + motion.rotation.norm() * radius;
}

/// `displacement(X_WA, X_WB)` takes A to B; `displaced(X_WA, that)` is X_WB again.
[[nodiscard]] Displacement displacement(const Pose& X_WA, const Pose& X_WB);
[[nodiscard]] Pose displaced(const Pose& X_WA, const Displacement& motion_W);

}  // namespace tenon
