#include <algorithm>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon {
namespace {

/// Impulses of contacts that share a body settle in so many sweeps over all of them (Gauss-Seidel).
constexpr int kSweeps = 10;

/// [m/s] What slides more slowly does not slide.
constexpr double kStill = 1e-9;

}  // namespace

/// Of two that rub, the smoother one's; 0 when neither has a body, or when the pair has a friction of its
/// own: that acts in the island.
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
  if (flies(object)) {
    const Engine::FreeBody& body = *engine_->bodies[object.value];
    return body.V_WC.linear + body.V_WC.angular.cross(p_WP - motion.X_WO * body.rigid.centre());
  }
  if (!moves(object)) return Vector3::Zero();
  return motion.V_WO.linear + motion.V_WO.angular.cross(p_WP - motion.X_WO.translation());
}

/// [m/s] that an impulse of 1 N s along t at p gives the point there, along t.
double Environment::lightness(ObjectId object, const Vector3& p_WP, const Vector3& t_W) const noexcept {
  if (!flies(object)) return 0.0;
  const Engine::FreeBody& body = *engine_->bodies[object.value];
  const Vector3 arm = p_WP - objects_[object.value].X_WO * body.rigid.centre();
  const Vector3 lever = arm.cross(t_W);
  return 1.0 / body.rigid.mass() + lever.dot(body.inverse_inertia_W * lever);
}

void Environment::strike(ObjectId object, const Vector3& p_WP, const Vector3& impulse_W) noexcept {
  if (!flies(object)) return;
  Engine::FreeBody& body = *engine_->bodies[object.value];
  const Vector3 arm = p_WP - objects_[object.value].X_WO * body.rigid.centre();
  body.V_WC.linear += impulse_W / body.rigid.mass();
  body.V_WC.angular += body.inverse_inertia_W * arm.cross(impulse_W);
}

/// Coulomb's friction between free bodies and what they touch, on their velocities before the tick's motion:
/// at each contact an impulse against sliding, at most the coefficient times the normal force that the last
/// tick found there. So what rests stays, and what slides is slowed; a hand feels none of it.
void Environment::rub() noexcept {
  Engine& engine = *engine_;
  engine.rubs.clear();
  for (const std::uint32_t i : engine.near) {
    const CollPair& pair = engine.pairs[i];
    const PairSpec& spec = pair.spec();
    const IslandPairResult* last = pair.solvedBefore(tick_);
    if (last == nullptr || spec.sensing || !(flies(spec.a) || flies(spec.b))) continue;
    const double friction = frictionOf(spec);
    if (friction <= 0.0) continue;
    const ContactList& contacts = last->query.contacts;
    for (std::size_t c = 0; c < contacts.size() && engine.rubs.size() < engine.rubs.capacity(); ++c) {
      const double most = friction * last->multipliers[c] * kTickSeconds;
      if (most > 0.0) {
        engine.rubs.push_back({spec.a, spec.b, contacts[c].p_WP, contacts[c].n_W, most, Vector3::Zero()});
      }
    }
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Engine::Rub& rub : engine.rubs) {
      const Vector3 relative = velocityOf(rub.a, rub.p_WP) - velocityOf(rub.b, rub.p_WP);
      const Vector3 sliding = relative - rub.n_W.dot(relative) * rub.n_W;
      const double speed = sliding.norm();
      if (speed < kStill) continue;
      const Vector3 t_W = sliding / speed;
      const double light = lightness(rub.a, rub.p_WP, t_W) + lightness(rub.b, rub.p_WP, t_W);
      Vector3 impulse = rub.impulse_W - (speed / light) * t_W;
      const double size = impulse.norm();
      if (size > rub.most) impulse *= rub.most / size;
      const Vector3 change = impulse - rub.impulse_W;
      rub.impulse_W = impulse;
      strike(rub.a, rub.p_WP, change);
      strike(rub.b, rub.p_WP, -change);
    }
  }
}

}  // namespace tenon
