#include "clients/haptic/virtual_fixture.h"

#include <algorithm>
#include <cmath>

namespace tenon::haptic {

namespace {
constexpr double kVelocityFilter = 0.005;     // [s] as that of the coupling
constexpr double kLongestAnchorStep = 0.002;  // [s] in which limit and anchor move, however long a cycle took

bool isSound(const Guidance& guidance) {
  const auto within = [](double value, double most) { return value >= 0.0 && value <= most; };
  return guidance.X_WF.isFinite() && std::abs(guidance.X_WF.rotation().squaredNorm() - 1.0) < 1e-3 &&
         within(guidance.radius, 1.0) && within(guidance.stiffness, 1e4) &&
         within(guidance.rotational_stiffness, 1e3) && within(guidance.damping, 1e3);
}
}  // namespace

VirtualFixture::VirtualFixture(const FixtureLimits& limits) : limits_(limits) {
  limits_.stiffness = std::min(limits_.stiffness, kStiffness);
  limits_.force = std::min(limits_.force, kForce);
  limits_.torque = std::min(limits_.torque, kTorque);
}

void VirtualFixture::receive(const Guidance& guidance) noexcept {
  const bool is_older = guidance.server_epoch < newest_.server_epoch ||
                        (guidance.server_epoch == newest_.server_epoch && guidance.tick <= newest_.tick);
  if (has_newest_ && is_older) return;
  newest_ = guidance;
  if (!isSound(guidance)) newest_.mode = GuidanceMode::kOff;
  has_newest_ = true;
  age_ = 0.0;
}

void VirtualFixture::restart() noexcept {
  share_ = 0.0;
  force_ = 0.0;
  has_hand_ = false;
}

void VirtualFixture::begin(const Pose& X_WH) noexcept {
  current_ = newest_;
  p_WF_ = newest_.X_WF.translation();
  p_WA_ = X_WH.translation();
  q_WA_ = X_WH.rotation();
  nearest_ = constrained(p_WF_ - p_WA_).norm();
}

Vector3 VirtualFixture::constrained(const Vector3& v) const noexcept {
  if (current_.kind == FixtureKind::kPose) return v;
  const Vector3 z_F = current_.X_WF.rotation() * Vector3::UnitZ();
  const Vector3 along = z_F * z_F.dot(v);
  return current_.kind == FixtureKind::kPlane ? along : Vector3(v - along);
}

void VirtualFixture::updateVelocity(const Vector3& p_WH, double dt) noexcept {
  if (has_hand_) v_WH_ += dt / (kVelocityFilter + dt) * ((p_WH - p_WH_) / dt - v_WH_);
  if (!has_hand_) v_WH_.setZero();
  p_WH_ = p_WH;
  has_hand_ = true;
}

Wrench VirtualFixture::step(const Pose& X_WH, double dt, bool permitted) noexcept {
  age_ += dt;
  updateVelocity(X_WH.translation(), dt);
  const bool is_there = permitted && has_newest_ && newest_.mode != GuidanceMode::kOff && age_ <= kStaleAt &&
                        limits_.force > 0.0;
  if (is_there && share_ <= 0.0) begin(X_WH);
  const bool on = is_there && newest_.choice == current_.choice && newest_.mode == current_.mode &&
                  newest_.kind == current_.kind && newest_.server_epoch == current_.server_epoch;
  if (on) current_ = newest_;
  const double grown = std::min(dt, kLongestAnchorStep) / kRamp;
  share_ = std::clamp(share_ + (on ? grown : -grown), 0.0, 1.0);
  force_ = 0.0;
  if (share_ <= 0.0) return {};

  stiffness_ = std::min(current_.stiffness, limits_.stiffness);
  rotational_stiffness_ = std::min(current_.rotational_stiffness, limits_.rotational_stiffness);
  Wrench wrench;
  if (stiffness_ > 0.0) {
    const double moved = kGrowth / stiffness_ * std::min(dt, kLongestAnchorStep);
    p_WF_ += clampNorm(current_.X_WF.translation() - p_WF_, moved);
    const Vector3 p_HF_W = constrained(p_WF_ - X_WH.translation());
    wrench.force = current_.mode == GuidanceMode::kResist
                       ? resist(p_HF_W)
                       : lead(X_WH.translation(), p_HF_W, on ? moved : 0.0);
  }
  if (rotational_stiffness_ > 0.0 && current_.mode == GuidanceMode::kLead)
    wrench.torque = turn(X_WH.rotation(), on ? grown * limits_.torque / rotational_stiffness_ : 0.0);
  // where the spring is slack, as within a tube, the hand is free
  if (!wrench.force.isZero(0.0)) {
    const double damping = share_ * std::min(current_.damping, limits_.damping);
    wrench.force -= damping * constrained(v_WH_);
  }
  wrench.force = clampNorm(wrench.force, share_ * limits_.force);
  force_ = wrench.force.norm();
  return wrench;
}

Vector3 VirtualFixture::lead(const Vector3& p_WH, const Vector3& p_HF_W, double moved) noexcept {
  const double slack = current_.kind == FixtureKind::kTube ? current_.radius : 0.0;
  Vector3 p_HA_W = constrained(p_WA_ - p_WH);
  p_HA_W += clampNorm(p_HF_W - p_HA_W, moved);
  p_HA_W = clampNorm(p_HA_W, slack + share_ * limits_.force / stiffness_);
  p_WA_ = p_WH + p_HA_W;
  const double length = p_HA_W.norm();
  return length > slack ? Vector3(p_HA_W * (stiffness_ * (length - slack) / length)) : Vector3::Zero();
}

Vector3 VirtualFixture::resist(const Vector3& p_HF_W) noexcept {
  const double slack = current_.kind == FixtureKind::kTube ? current_.radius : 0.0;
  const double distance = p_HF_W.norm();
  nearest_ = std::min(nearest_, distance);
  nearest_ = std::max({nearest_, distance - share_ * limits_.force / stiffness_, std::min(slack, distance)});
  return distance > nearest_ ? Vector3(p_HF_W * (stiffness_ * (distance - nearest_) / distance))
                             : Vector3::Zero();
}

Vector3 VirtualFixture::turn(const Quaternion& q_WH, double turned) noexcept {
  Vector3 from_hand = logRotation(q_WA_ * q_WH.conjugate());
  const Vector3 goal = logRotation(current_.X_WF.rotation() * q_WH.conjugate());
  from_hand += clampNorm(goal - from_hand, turned);
  from_hand = clampNorm(from_hand, share_ * limits_.torque / rotational_stiffness_);
  q_WA_ = (expRotation(from_hand) * q_WH).normalized();
  return rotational_stiffness_ * from_hand;
}

}  // namespace tenon::haptic
