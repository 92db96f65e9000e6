#include "idl/types/spatial.h"

#include <numbers>

namespace tenon {
namespace {

/// [rad] atan(x) for x >= 0: atan(x) = 2 atan(x / (1 + sqrt(1 + x^2))) three times, then the Taylor series.
double arcTangent(double x) {
  double scale = 1.0;
  for (int halving = 0; halving < 3; ++halving) {
    x = x / (1.0 + std::sqrt(1.0 + x * x));
    scale *= 2.0;
  }
  const double x2 = x * x;
  double sum = 0.0;
  for (int k = 23; k >= 1; k -= 2) sum = 1.0 / k - x2 * sum;
  return scale * x * sum;
}

}  // namespace

double angleOf(double y, double x) {
  if (x > 0.0) return arcTangent(y / x);
  if (x < 0.0) return std::numbers::pi - arcTangent(y / -x);
  return y > 0.0 ? std::numbers::pi / 2.0 : 0.0;
}

Quaternion expRotation(const Vector3& w) {
  // sin and cos of an eighth of the half angle by their Taylor series, then three squarings: exact to 1e-13
  // for |w| <= pi
  constexpr int kSquarings = 3;
  const Vector3 h = w * (0.5 / (1 << kSquarings));
  const double a2 = h.squaredNorm();
  double sinc = 0.0;
  double cosine = 0.0;
  for (int k = 8; k >= 0; --k) {
    sinc = 1.0 - a2 / ((2.0 * k + 2.0) * (2.0 * k + 3.0)) * sinc;
    cosine = 1.0 - a2 / ((2.0 * k + 1.0) * (2.0 * k + 2.0)) * cosine;
  }
  Quaternion q(cosine, sinc * h.x(), sinc * h.y(), sinc * h.z());
  for (int k = 0; k < kSquarings; ++k) q = q * q;
  return q.normalized();
}

Vector3 logRotation(const Quaternion& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Vector3 v = sign * q.vec();
  const double s = v.norm();
  if (s < 1e-9) return 2.0 * v;
  return v * (2.0 * angleOf(s, sign * q.w()) / s);
}

Displacement displacement(const Pose& X_WA, const Pose& X_WB) {
  return {X_WB.translation() - X_WA.translation(),
          logRotation(X_WB.rotation() * X_WA.rotation().conjugate())};
}

Displacement displacement(const Pose& X_WA, const Pose& X_WB, const Vector3& p_OQ_O) {
  return {X_WB * p_OQ_O - X_WA * p_OQ_O, logRotation(X_WB.rotation() * X_WA.rotation().conjugate())};
}

Pose displaced(const Pose& X_WA, const Displacement& motion_W) {
  return {X_WA.translation() + motion_W.translation,
          (expRotation(motion_W.rotation) * X_WA.rotation()).normalized()};
}

Pose displaced(const Pose& X_WA, const Displacement& motion_W, const Vector3& p_OQ_O) {
  const Quaternion q_WB = (expRotation(motion_W.rotation) * X_WA.rotation()).normalized();
  return {X_WA * p_OQ_O + motion_W.translation - q_WB * p_OQ_O, q_WB};
}

}  // namespace tenon
