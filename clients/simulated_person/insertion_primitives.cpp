#include "clients/simulated_person/insertion_primitives.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace tenon::simulated_person {
namespace {

constexpr double kUpright = 1.9;  // [-] height over depth above which an object is touched from the front
constexpr double kVisibleTilt = 0.04;    // [rad] smallest tilt that is perceived
constexpr double kTiltRate = 1.5;        // [1/s] correction rate of a visible tilt
constexpr double kMaxTurn = 0.3;         // [rad] range of the wrist
constexpr double kPushGain = 0.012;      // [m/s per N] of the force control
constexpr double kSpiralPitch = 0.0008;  // [m] growth of the radius per revolution
constexpr double kSpiralSpeed = 0.015;   // [m/s] along the spiral
constexpr double kTilt = 0.012;          // [rad] amplitude
constexpr double kTwist = 0.035;   // [rad] amplitude about the axis, where no other motion turns the object
constexpr double kTiltPace = 7.0;  // [rad/s] angular frequency of tilt and twist

/// Rotates (cos, sin) by a small angle: a symplectic Euler step, so the norm stays near 1.
void turn(Vector3& phasor, double angle) {
  phasor.x() -= angle * phasor.y();
  phasor.y() += angle * phasor.x();
}

}  // namespace

void orthonormalBasis(const Vector3& axis, Vector3& u, Vector3& v) noexcept {
  const Vector3 other = std::abs(axis.z()) < 0.9 ? Vector3::UnitZ() : Vector3::UnitX();
  u = axis.cross(other).normalized();
  v = axis.cross(u);
}

Displacement decayed(const Displacement& offset, double dt, double time) noexcept {
  const double remaining = 1.0 - std::min(1.0, dt / time);
  return {offset.translation * remaining, offset.rotation * remaining};
}

Vector3 touchNormal(const Vector3& size_W) noexcept {
  const bool upright = size_W.z() > kUpright * size_W.y();
  return upright ? Vector3(-Vector3::UnitY()) : Vector3(Vector3::UnitZ());
}

Vector3 probeOffset(unsigned attempt) noexcept {
  static constexpr double kProbes[][3] = {{0.0, 0.0, -0.04}, {0.06, 0.0, 0.0}, {-0.06, 0.0, 0.0},
                                          {0.0, 0.0, 0.04},  {0.0, 0.06, 0.0}, {0.0, -0.06, 0.0},
                                          {0.0, 0.0, -0.1}};
  const auto& probe = kProbes[attempt % std::size(kProbes)];
  return {probe[0], probe[1], probe[2]};
}

double pushStep(double target_force, double measured_force, double max_speed, double dt) noexcept {
  return std::clamp(kPushGain * (target_force - measured_force), -max_speed, max_speed) * dt;
}

Pose compliedLaterally(const Pose& X_WO, const Pose& X_WAim, const Vector3& p_OQ_O, const Vector3& axis_W,
                       double fraction) noexcept {
  const Displacement off = displacement(X_WAim, X_WO, p_OQ_O);
  const Vector3 lateral = off.translation - off.translation.dot(axis_W) * axis_W;
  Pose X_WComplied = X_WAim;
  X_WComplied.translation() += fraction * lateral;
  return X_WComplied;
}

Pose compliedInRotation(const Pose& X_WO, const Pose& X_WAim, const Pose& X_WG, const Vector3& p_OQ_O,
                        double fraction) noexcept {
  if (displacement(X_WG, X_WO).rotation.norm() > kVisibleTilt) return X_WAim;
  const Vector3 turned = fraction * displacement(X_WAim, X_WO).rotation;
  return displaced(X_WAim, {Vector3::Zero(), turned}, p_OQ_O);
}

Vector3 tiltCorrection(const Vector3& turned_W, const Pose& X_WO, const Pose& X_WAim, double dt) noexcept {
  const Vector3 off = displacement(X_WO, X_WAim).rotation;
  const double angle = off.norm();
  Vector3 turned = turned_W;
  if (angle > kVisibleTilt) turned += kTiltRate * dt * (1.0 - kVisibleTilt / angle) * off;
  return clampNorm(turned, kMaxTurn);
}

void SpiralSearch::step(bool near, double dt) noexcept {
  const double pace = (near ? 0.3 : 1.0) * kSpiralSpeed / std::max(0.002, radius_);
  turn(spiral_, pace * dt);
  radius_ += kSpiralPitch * pace * dt / (2.0 * std::numbers::pi);
  turn(tilt_, kTiltPace * dt);
}

Vector3 SpiralSearch::offset(const Vector3& axis_W) const noexcept {
  Vector3 u, v;
  orthonormalBasis(axis_W, u, v);
  return radius_ * (spiral_.x() * u + spiral_.y() * v);
}

Quaternion SpiralSearch::tilt(const Vector3& axis_W) const noexcept {
  Vector3 u, v;
  orthonormalBasis(axis_W, u, v);
  return expRotation(kTilt * tilt_.x() * (spiral_.y() * u - spiral_.x() * v) + kTwist * tilt_.y() * axis_W);
}

void StallDetector::start(double depth) noexcept {
  time_ = 0.0;
  depth_ = depth;
}

bool StallDetector::stalled(double depth, double progress) noexcept {
  constexpr double kPeriod = 0.4;  // [s]
  time_ += 1e-3;
  if (time_ < kPeriod) return false;
  const bool stalled = depth - depth_ < progress;
  start(depth);
  return stalled;
}

}  // namespace tenon::simulated_person
