#include "clients/trainee/assembly_abilities.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace tenon {
namespace {

constexpr double kUpright = 1.9;         // times as high as deep: it is taken from the front, not from above
constexpr double kTiltSeen = 0.04;       // [rad] a tilt that strikes the eye
constexpr double kTiltRate = 1.5;        // [1/s] at which she turns her hand against it
constexpr double kMostTurned = 0.3;      // [rad] she turns her hand
constexpr double kPushGain = 0.012;      // [m/s per N] how quickly a hand gives way or follows
constexpr double kSpiralPitch = 0.0008;  // [m]
constexpr double kSpiralSpeed = 0.015;   // [m/s]
constexpr double kTilt = 0.012;          // [rad] of the wiggle
constexpr double kTwist = 0.035;         // [rad] likewise, about the axis: nothing else turns it there
constexpr double kTiltPace = 7.0;        // [rad/s]

/// A turn of (cos, sin) by a small angle; stays on the circle without trigonometry.
void turn(Vector3& phasor, double angle) {
  phasor.x() -= angle * phasor.y();
  phasor.y() += angle * phasor.x();
}

}  // namespace

void besides(const Vector3& axis, Vector3& u, Vector3& v) noexcept {
  const Vector3 other = std::abs(axis.z()) < 0.9 ? Vector3::UnitZ() : Vector3::UnitX();
  u = axis.cross(other).normalized();
  v = axis.cross(u);
}

Vector3 noLongerThan(const Vector3& v, double most) noexcept {
  const double length = v.norm();
  return length > most ? Vector3(v * (most / length)) : v;
}

Displacement faded(const Displacement& carried, double dt, double time) noexcept {
  const double left = 1.0 - std::min(1.0, dt / time);
  return {carried.translation * left, carried.rotation * left};
}

Vector3 sideToTouch(const Vector3& size_W) noexcept {
  const bool upright = size_W.z() > kUpright * size_W.y();
  return upright ? Vector3(-Vector3::UnitY()) : Vector3(Vector3::UnitZ());
}

Vector3 probeAround(unsigned attempt) noexcept {
  static constexpr double kProbes[][3] = {{0.0, 0.0, -0.04}, {0.06, 0.0, 0.0}, {-0.06, 0.0, 0.0},
                                          {0.0, 0.0, 0.04},  {0.0, 0.06, 0.0}, {0.0, -0.06, 0.0},
                                          {0.0, 0.0, -0.1}};
  const auto& probe = kProbes[attempt % std::size(kProbes)];
  return {probe[0], probe[1], probe[2]};
}

double pushStep(double wanted_force, double felt, double highest_speed, double dt) noexcept {
  return std::clamp(kPushGain * (wanted_force - felt), -highest_speed, highest_speed) * dt;
}

Pose yieldedTo(const Pose& X_WO, const Pose& X_WAim, const Vector3& axis_W, double share) noexcept {
  const Displacement off = displacement(X_WAim, X_WO);
  const Vector3 lateral = off.translation - off.translation.dot(axis_W) * axis_W;
  Pose X_WYielded = X_WAim;
  X_WYielded.translation() += share * lateral;
  return X_WYielded;
}

Pose compliedWith(const Pose& X_WO, const Pose& X_WAim, const Pose& X_WG, double share) noexcept {
  if (displacement(X_WG, X_WO).rotation.norm() > kTiltSeen) return X_WAim;
  const Vector3 turned = share * displacement(X_WAim, X_WO).rotation;
  return displaced(X_WAim, {Vector3::Zero(), turned});
}

Vector3 uprightAgain(const Vector3& turned_W, const Pose& X_WO, const Pose& X_WAim, double dt) noexcept {
  const Vector3 off = displacement(X_WO, X_WAim).rotation;
  const double angle = off.norm();
  Vector3 turned = turned_W;
  if (angle > kTiltSeen) turned += kTiltRate * dt * (1.0 - kTiltSeen / angle) * off;
  return noLongerThan(turned, kMostTurned);
}

void Wiggle::step(bool near, double dt) noexcept {
  const double pace = (near ? 0.3 : 1.0) * kSpiralSpeed / std::max(0.002, radius_);
  turn(spiral_, pace * dt);
  radius_ += kSpiralPitch * pace * dt / (2.0 * std::numbers::pi);
  turn(tilt_, kTiltPace * dt);
}

Vector3 Wiggle::way(const Vector3& axis_W) const noexcept {
  Vector3 u, v;
  besides(axis_W, u, v);
  return radius_ * (spiral_.x() * u + spiral_.y() * v);
}

Quaternion Wiggle::tilt(const Vector3& axis_W) const noexcept {
  Vector3 u, v;
  besides(axis_W, u, v);
  return expRotation(kTilt * tilt_.x() * (spiral_.y() * u - spiral_.x() * v) + kTwist * tilt_.y() * axis_W);
}

void StallWatch::start(double depth) noexcept {
  time_ = 0.0;
  depth_ = depth;
}

bool StallWatch::stalled(double depth, double way) noexcept {
  constexpr double kLookAgain = 0.4;  // [s]
  time_ += 1e-3;
  if (time_ < kLookAgain) return false;
  const bool still = depth - depth_ < way;
  start(depth);
  return still;
}

}  // namespace tenon
