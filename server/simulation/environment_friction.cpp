#include <algorithm>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// Gauss-Seidel sweeps over all friction contacts.
constexpr int kSweeps = 10;

/// [m/s] Slower relative motion counts as sticking.
constexpr double kMinSlidingSpeed = 1e-9;

}  // namespace

/// [-] Coulomb coefficient of a pair: the smaller one of its bodies. 0 when neither has a body, or when the
/// pair has a friction of its own, which the island solver applies.
double Environment::frictionOf(const PairSpec& pair) const noexcept {
  if (pair.friction) return 0.0;
  const std::optional<BodySpec>& a = scene_->objects[pair.a.value].body;
  const std::optional<BodySpec>& b = scene_->objects[pair.b.value].body;
  if (a && b) return std::min(a->friction, b->friction);
  if (a) return a->friction;
  return b ? b->friction : 0.0;
}

Vector3 Environment::velocityOf(ObjectId object, const Vector3& p_WP) const noexcept {
  const ObjectMotion& motion = objects_[object.value];
  if (isDynamic(object)) {
    const Engine::FreeBody& body = *engine_->bodies[object.value];
    return body.V_WC.linear + body.V_WC.angular.cross(p_WP - motion.X_WO * body.rigid.centre());
  }
  if (!moves(object)) return Vector3::Zero();
  return motion.V_WO.linear + motion.V_WO.angular.cross(p_WP - motion.X_WO.translation());
}

/// [1/kg] velocity change along t_W at point P per impulse along t_W at P; 0 for kinematic objects.
double Environment::inverseEffectiveMass(ObjectId object, const Vector3& p_WP,
                                         const Vector3& t_W) const noexcept {
  if (!isDynamic(object)) return 0.0;
  const Engine::FreeBody& body = *engine_->bodies[object.value];
  const Vector3 arm = p_WP - objects_[object.value].X_WO * body.rigid.centre();
  const Vector3 lever = arm.cross(t_W);
  return 1.0 / body.rigid.mass() + lever.dot(body.inverse_inertia_W * lever);
}

void Environment::applyImpulse(ObjectId object, const Vector3& p_WP, const Vector3& impulse_W) noexcept {
  if (!isDynamic(object)) return;
  Engine::FreeBody& body = *engine_->bodies[object.value];
  const Vector3 arm = p_WP - objects_[object.value].X_WO * body.rigid.centre();
  body.V_WC.linear += impulse_W / body.rigid.mass();
  body.V_WC.angular += body.inverse_inertia_W * arm.cross(impulse_W);
}

/// Coulomb friction between free bodies and what they touch, as sequential impulses on the predicted
/// velocities before the tick's solve. Per contact the impulse against sliding is at most the coefficient
/// times the normal impulse of the last tick. Held objects are treated as kinematic: the hand gets no
/// reaction.
void Environment::applyFreeBodyFriction() noexcept {
  Engine& engine = *engine_;
  engine.friction_contacts.clear();
  for (const std::uint32_t i : engine.near) {
    const CollPair& pair = engine.pairs[i];
    const PairSpec& spec = pair.spec();
    const collision::IslandPairResult* last = pair.solvedBefore(tick_);
    if (last == nullptr || spec.sensing || !(isDynamic(spec.a) || isDynamic(spec.b))) continue;
    const double friction = frictionOf(spec);
    if (friction <= 0.0) continue;
    const collision::ContactList& contacts = last->query.contacts;
    for (std::size_t c = 0;
         c < contacts.size() && engine.friction_contacts.size() < engine.friction_contacts.capacity(); ++c) {
      const double max_impulse = friction * last->multipliers[c] * kTickSeconds;
      if (max_impulse > 0.0) {
        engine.friction_contacts.push_back(
            {spec.a, spec.b, contacts[c].p_WP, contacts[c].n_W, max_impulse, Vector3::Zero()});
      }
    }
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Engine::FrictionContact& contact : engine.friction_contacts) {
      const Vector3 relative = velocityOf(contact.a, contact.p_WP) - velocityOf(contact.b, contact.p_WP);
      const Vector3 sliding = relative - contact.n_W.dot(relative) * contact.n_W;
      const double speed = sliding.norm();
      if (speed < kMinSlidingSpeed) continue;
      const Vector3 t_W = sliding / speed;
      const double inverse_mass = inverseEffectiveMass(contact.a, contact.p_WP, t_W) +
                                  inverseEffectiveMass(contact.b, contact.p_WP, t_W);
      Vector3 impulse = contact.impulse_W - (speed / inverse_mass) * t_W;
      const double magnitude = impulse.norm();
      if (magnitude > contact.max_impulse) impulse *= contact.max_impulse / magnitude;
      const Vector3 change = impulse - contact.impulse_W;
      contact.impulse_W = impulse;
      applyImpulse(contact.a, contact.p_WP, change);
      applyImpulse(contact.b, contact.p_WP, -change);
    }
  }
}

}  // namespace tenon::simulation
