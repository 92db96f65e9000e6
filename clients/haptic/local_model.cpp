#include "clients/haptic/local_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "idl/types/motion_law.h"

namespace tenon::haptic {

namespace {
// A smaller multiplier is rounding: the constraint is not active.
constexpr double kMinMultiplier = 1e-9;  // [N]

// Scale of rotations of an object of unknown size.
constexpr double kUnknownRadius = 0.1;  // [m]

// In which another hand's spring gets its stiffness, and loses it after the hand has released the object.
constexpr double kFadeTicks = 20.0;  // [ticks]

// After that manifolds of each tick have a gap.
constexpr double kLate = 1.5 * kTickSeconds;  // [s]

// Velocities above this are single-tick displacements and are not extrapolated.
constexpr double kFast = 1.0;  // [m/s]

/// [m] Of a contact's point of the other body, from its pose of tick `heard_at` to `now`. Slow motion is that
/// of what gives way to this hand.
Vector3 expectedMotion(const ManifoldContact& contact, Tick heard_at, double now) {
  const double ahead = (now - static_cast<double>(heard_at)) * kTickSeconds;
  const Vector3 v_W = contact.velocity_W.cast<double>();
  const double speed = v_W.norm();
  const double weight = extrapolationWeight(speed) * std::clamp(2.0 - speed / kFast, 0.0, 1.0);
  const Vector3 way = weight * std::clamp(ahead, 0.0, LocalModel::kLongestExpectation) * v_W;
  return clampNorm(way, LocalModel::kFarthestExpectation);
}

/// An offset that is shorter by so much that the force, or torque, of the spring changes by `step` at most.
Vector3 shortened(const Vector3& offset, double step, double stiffness) {
  const double length = offset.norm();
  return length * stiffness <= step ? Vector3::Zero().eval() : offset * (1.0 - step / (length * stiffness));
}

/// Where `motion` brings a body that nothing holds but its springs. Where two of them are far from their
/// goals and turn it, a linearised step ends beyond the rest and the next one farther on the other side: of
/// one that lowers the springs' energy by less than half of what it should, so much is taken as a parabola
/// says.
Pose movedBySprings(const collision::MovableBody& body, const Displacement& motion) {
  constexpr double kRounding = 1e-12;  // [-]
  double before = 0.0, after = 0.0;    // [J]
  double slope = 0.0;                  // [J] per motion
  const Pose X_WB = displaced(body.X_WB, motion, body.p_BQ);
  const Vector3 p_QBo_W = -(body.X_WB.rotation() * body.p_BQ);
  for (const collision::Spring& spring : body.springs) {
    before += collision::springEnergy(spring, body.X_WB);
    after += collision::springEnergy(spring, X_WB);
    const Wrench F_Bo_W = collision::springWrench(spring, body.X_WB);
    slope -= F_Bo_W.force.dot(motion.translation) +
             (F_Bo_W.torque + p_QBo_W.cross(F_Bo_W.force)).dot(motion.rotation);
  }
  if (!(after - before > 0.25 * slope + kRounding * before)) return X_WB;
  const double share = -0.5 * slope / (after - before - slope);
  return displaced(body.X_WB, {share * motion.translation, share * motion.rotation}, body.p_BQ);
}

bool isFinite(const HandPull& pull) {
  return pull.X_WG.isFinite() && pull.V_WG.allFinite() && pull.p_BoC_B.allFinite() &&
         std::isfinite(pull.stiffness) && std::isfinite(pull.rotational_stiffness);
}

bool anyBodyJumped(const HandManifold& before, const HandManifold& now) {
  return std::any_of(now.bodies.begin(), now.bodies.end(), [&](const ManifoldBody& body) {
    return std::any_of(before.bodies.begin(), before.bodies.end(), [&](const ManifoldBody& known) {
      return known.object == body.object && known.epoch != body.epoch;
    });
  });
}
}  // namespace

LocalModel::LocalModel() : solver_(1, kManifoldContacts) {}

void LocalModel::receive(const HandManifold& manifold) noexcept {
  if (!manifold.X_WO.isFinite() || !manifold.X_HO.isFinite()) return;
  if (has_manifold_) {
    if (manifold.server_epoch < manifold_.server_epoch) return;
    if (manifold.server_epoch == manifold_.server_epoch && manifold.tick < manifold_.tick) return;
  }
  const bool same = has_manifold_ && manifold.server_epoch == manifold_.server_epoch &&
                    manifold.object == manifold_.object && manifold.object_epoch == manifold_.object_epoch;
  if (!same || anyBodyJumped(manifold_, manifold)) jumped_ = true;
  const Tick since = has_manifold_ ? manifold.tick - manifold_.tick : 0;
  late_ = late_ || since > 1 || manifold_age_ > kLate;
  if (!same || since > 0) manifold_age_ = 0.0;
  manifold_ = manifold;
  updateOtherSprings(same, late_);
  has_manifold_ = true;
}

bool LocalModel::usable(const WorldView& world) const noexcept {
  return has_manifold_ && manifold_.object.valid() && !manifold_.frozen && !outdated(world);
}

const LocalProxy& LocalModel::step(const Pose& X_WH, const WorldView& world) noexcept {
  const bool was_active = proxy_.active;
  manifold_age_ += kTickSeconds;
  late_ = false;
  proxy_.discontinuous = false;
  proxy_.active = usable(world);
  stepped_tick_ = manifold_.tick;
  if (!proxy_.active) {
    proxy_.discontinuous = was_active;
    proxy_.touching = false;
    proxy_.stiffness = proxy_.rotational_stiffness = 0.0;
    proxy_.X_WS = X_WH;
    proxy_.X_WO = has_manifold_ ? X_WH * manifold_.X_HO : X_WH;
    return proxy_;
  }
  if (jumped_ || !was_active) {
    // the new planes fit the server's proxy only
    proxy_.discontinuous = was_active;
    proxy_.X_WO = manifold_.X_WO;
    for (OtherHandSpring& other : other_springs_) {
      other.X_WG = other.pull.X_WG;
      other.offset = {};
    }
    jumped_ = false;
  }
  proxy_.stiffness = manifold_.stiffness;
  proxy_.rotational_stiffness = manifold_.rotational_stiffness;
  moveOtherSprings();
  solve(X_WH, world);
  proxy_.X_WS = proxy_.X_WO * manifold_.X_HO.inverse();
  updateValidityCount();
  return proxy_;
}

void LocalModel::updateOtherSprings(bool same_object, bool after_gap) noexcept {
  if (!same_object) other_springs_.clear();
  for (OtherHandSpring& known : other_springs_) known.listed = false;
  for (const HandPull& pull : manifold_.others) {
    if (pull.object != manifold_.object || !isFinite(pull)) continue;
    auto* const known =
        std::find_if(other_springs_.begin(), other_springs_.end(),
                     [&](const OtherHandSpring& other) { return other.pull.hand == pull.hand; });
    if (known != other_springs_.end()) {
      if (after_gap) known->offset = displacement(pull.X_WG, known->X_WG, pull.p_BoC_B);
      known->pull = pull;
      known->listed = true;
    } else {
      other_springs_.push_back({.pull = pull, .X_WG = pull.X_WG, .weight = same_object ? 0.0 : 1.0});
    }
  }
}

void LocalModel::moveOtherSprings() noexcept {
  // a manifold that came in this cycle is told as it is
  const double ahead = std::min(manifold_age_ - kTickSeconds, kLongestExpectation);
  std::size_t kept = 0;
  for (OtherHandSpring& other : other_springs_) {
    other.weight = std::min(1.0, other.weight + (other.listed ? 1.0 : -1.0) / kFadeTicks);
    if (other.weight <= 0.0) continue;
    if (!other.listed) {  // it fades where it is
      other_springs_[kept++] = other;
      continue;
    }
    const HandPull& pull = other.pull;
    const Twist V_WG{pull.V_WG.head<3>().cast<double>(), pull.V_WG.tail<3>().cast<double>()};
    other.X_WG = ahead > 0.0 ? extrapolated(pull.X_WG, V_WG, pull.p_BoC_B, ahead) : pull.X_WG;
    Displacement& offset = other.offset;
    offset.translation = shortened(offset.translation, kGoalForceStep, pull.stiffness);
    offset.rotation = shortened(offset.rotation, kGoalTorqueStep, pull.rotational_stiffness);
    if (!offset.translation.isZero(0.0) || !offset.rotation.isZero(0.0))
      other.X_WG = displaced(other.X_WG, offset, pull.p_BoC_B);
    other_springs_[kept++] = other;
  }
  other_springs_.resize(kept);
}

/// A body that is not listed may have jumped in a frame that is still to come: then it is not where the
/// manifold had it, beyond what its velocity explains.
bool LocalModel::isElsewhere(const ManifoldContact& contact, const WorldView& world) const noexcept {
  const bool listed = std::any_of(manifold_.bodies.begin(), manifold_.bodies.end(),
                                  [&](const ManifoldBody& body) { return body.object == contact.other; });
  if (listed || !world.contains(contact.other)) return false;
  const ObservedObject& other = world.object(contact.other);
  if (other.updated_at > manifold_.tick) return false;
  const double since = static_cast<double>(manifold_.tick - other.updated_at) * kTickSeconds;
  const double explained =
      kFarthestExpectation + contact.velocity_W.cast<double>().norm() * std::min(since, kLongestExpectation);
  const Vector3 p_WP = manifold_.X_WO * contact.p_BoP_B.cast<double>();
  const double gap =
      contact.normal_A.cast<double>().dot(other.X_WO.inverse() * p_WP) - static_cast<double>(contact.offset);
  return !(std::abs(gap - static_cast<double>(contact.gap)) <= explained);
}

bool LocalModel::outdated(const WorldView& world) const noexcept {
  if (world.serverEpoch() != manifold_.server_epoch) return false;
  if (world.contains(manifold_.object) && world.object(manifold_.object).epoch > manifold_.object_epoch)
    return true;
  // the planes of a body fit the poses of its own epoch alone, so a frame that is still to come is awaited
  const bool differs =
      std::any_of(manifold_.bodies.begin(), manifold_.bodies.end(), [&](const ManifoldBody& body) {
        return world.contains(body.object) && world.object(body.object).epoch != body.epoch;
      });
  // of bodies that are not listed, or were not before, the frames alone tell that they have jumped
  return differs || std::any_of(manifold_.contacts.begin(), manifold_.contacts.end(),
                                [&](const ManifoldContact& contact) {
                                  return isElsewhere(contact, world) ||
                                         (world.contains(contact.other) &&
                                          world.object(contact.other).jumped_at > stepped_tick_);
                                });
}

void LocalModel::solve(const Pose& X_WH, const WorldView& world) noexcept {
  const bool known = world.contains(manifold_.object) && world.object(manifold_.object).radius > 0.0;
  body_.p_BQ = known ? world.object(manifold_.object).p_OQ_O : Vector3::Zero();
  body_.radius = known ? world.object(manifold_.object).radius : kUnknownRadius;
  body_.X_WB = proxy_.X_WO;
  body_.springs.clear();
  body_.springs.push_back({X_WH * manifold_.X_HO, manifold_.X_HO.inverse().translation(),
                           std::max(1.0, manifold_.stiffness),
                           std::max(0.1, manifold_.rotational_stiffness)});
  // listed hands first, because the capacity is limited
  for (const bool listed : {true, false}) {
    for (const OtherHandSpring& other : other_springs_) {
      if (other.listed != listed) continue;
      const HandPull& pull = other.pull;
      body_.springs.push_back({other.X_WG, pull.p_BoC_B, other.weight * std::max(0.0, pull.stiffness),
                               other.weight * std::max(0.0, pull.rotational_stiffness)});
    }
  }
  constraints_.clear();
  for (const ManifoldContact& contact : manifold_.contacts) {
    if (!world.contains(contact.other)) continue;
    const Pose& X_WA = world.object(contact.other).X_WO;
    const Vector3 n_A = contact.normal_A.cast<double>();
    collision::ContactConstraint constraint;
    constraint.body_a = 0;
    constraint.n_W = X_WA.rotation() * n_A;
    constraint.p_WP = body_.X_WB * contact.p_BoP_B.cast<double>();
    constraint.gap =
        n_A.dot(X_WA.inverse() * constraint.p_WP) - static_cast<double>(contact.offset) -
        constraint.n_W.dot(expectedMotion(contact, world.object(contact.other).updated_at, now_));
    constraints_.push_back(constraint);
  }
  std::array<Displacement, 1> motion{};
  solver_.solve({&body_, 1}, {constraints_.begin(), constraints_.size()}, motion,
                {multipliers_.data(), constraints_.size()});
  proxy_.touching = std::any_of(multipliers_.begin(), multipliers_.begin() + constraints_.size(),
                                [](double multiplier) { return multiplier > kMinMultiplier; });
  proxy_.X_WO =
      proxy_.touching ? displaced(body_.X_WB, motion[0], body_.p_BQ) : movedBySprings(body_, motion[0]);
}

void LocalModel::updateValidityCount() noexcept {
  const double largest_displacement =
      maxPointMotion(displacement(manifold_.X_WO, proxy_.X_WO, body_.p_BQ), body_.radius);
  if (largest_displacement > manifold_.validity_radius) ++beyond_validity_;
}

}  // namespace tenon::haptic
