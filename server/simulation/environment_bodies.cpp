#include <algorithm>
#include <cmath>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon {
namespace {

/// [m/s] A body that rests on others and stays slower than this for so many ticks is put to sleep. Slower
/// than a step of the field a tick, faster than anybody sees; and a body that begins to fall leaves it
/// within the time.
constexpr double kCalmSpeed = 2e-3;
constexpr std::uint32_t kCalmTicks = 30;

/// [m] A free body in contact goes on as long as it has this much to go: the smallest push shall move it.
constexpr double kFreeSettled = 1e-9;

/// What stops short in a tick has lost momentum: an impact gets so many sub-steps to find its place.
constexpr std::uint32_t kImpactSubsteps = 10;

/// Sub-steps of a fast body add up to this many times its way, for what turns aside at a contact.
constexpr double kSpareTravel = 1.25;

/// [m] Whoever can meet nobody goes its way in one step.
constexpr double kNobodyNear = 1.0;

}  // namespace

bool Environment::flies(ObjectId object) const noexcept {
  return objects_[object.value].status == ObjectStatus::kFree && !objects_[object.value].asleep && !still_;
}

void Environment::setStill(bool still) noexcept {
  if (still_ == still) return;
  still_ = still;
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].status != ObjectStatus::kFree || objects_[i].asleep) continue;
    objects_[i].V_WO = Twist{};
    stir(ObjectId{i});
  }
}

bool Environment::moves(ObjectId object) const noexcept {
  return engine_->movable[object.value] != 0 || objects_[object.value].status == ObjectStatus::kTracked;
}

void Environment::wake(ObjectId object) noexcept {
  ObjectMotion& motion = objects_[object.value];
  motion.calm_ticks = 0;
  if (!motion.asleep) return;
  motion.asleep = false;
  stir(object);
}

void Environment::wakeNeighbours(ObjectId object) noexcept {
  for (const std::uint32_t i : engine_->near) {
    const PairSpec& spec = engine_->pairs[i].spec();
    if (spec.a == object) wake(spec.b);
    if (spec.b == object) wake(spec.a);
  }
}

/// Contacts that an island lists ahead count, so that who comes meets somebody awake; what two sleepers list
/// depends on whether they were looked at.
bool Environment::mayBeTouched(std::size_t pair) const noexcept {
  const CollPair& one = engine_->pairs[pair];
  return one.solvedBefore(tick_) != nullptr || (one.lists() && one.gap() <= engine_->limits.contact_margin);
}

/// Whoever lies at something that moves by itself, or at somebody who does, and so on.
void Environment::wakeWhatIsTouched() noexcept {
  bool more =
      std::any_of(objects_.begin(), objects_.end(), [](const ObjectMotion& one) { return one.asleep; });
  for (std::size_t pass = 0; more && pass < objects_.size(); ++pass) {
    more = false;
    for (const std::uint32_t i : engine_->near) {
      const CollPair& pair = engine_->pairs[i];
      if (pair.spec().sensing || !active(i) || !mayBeTouched(i)) continue;
      for (const auto& [one, other] :
           {std::pair(pair.spec().a, pair.spec().b), std::pair(pair.spec().b, pair.spec().a)}) {
        if (!objects_[other.value].asleep || !moves(one)) continue;
        wake(other);
        engine_->movable[other.value] = 1;
        more = true;
      }
    }
  }
}

/// Velocities of all free bodies at the end of the tick, when nothing is in their way.
void Environment::fly() noexcept {
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (!flies(ObjectId{i})) continue;
    Engine::FreeBody& body = *engine_->bodies[i];
    const Pose& X_WO = objects_[i].X_WO;
    const Wrench F_Oo_W = engine_->forces[i].contributed(tick_);
    body.V_WC = body.rigid.fly(X_WO.rotation(), atCentre(objects_[i].V_WO, X_WO, body.rigid.centre()),
                               shifted(F_Oo_W, X_WO.rotation() * body.rigid.centre()));
    body.inverse_inertia_W = body.rigid.inertia(X_WO.rotation()).inverse();
  }
  rub();
}

/// Where the body flies when nothing is in its way, as the spring that its inertia is over a tick.
MovableBody Environment::freeBody(ObjectId object) noexcept {
  const ObjectMotion& motion = objects_[object.value];
  const RigidBody& rigid = engine_->bodies[object.value]->rigid;
  Twist& V_WC = engine_->bodies[object.value]->V_WC;
  const double radius = engine_->sizes[object.value].radius;
  const Vector3 p_OC_W = motion.X_WO.rotation() * rigid.centre();
  const Vector3 v_WOo = V_WC.linear - V_WC.angular.cross(p_OC_W);
  const double speed = std::max(fastestPoint(Twist{v_WOo, V_WC.angular}, radius), fastestPoint(V_WC, radius));
  if (speed > options_.max_free_speed) {
    V_WC.linear *= options_.max_free_speed / speed;
    V_WC.angular *= options_.max_free_speed / speed;
  }

  Spring inertia;
  inertia.p_BC = rigid.centre();
  inertia.X_WG.rotation() = displaced(motion.X_WO, {Vector3::Zero(), kTickSeconds * V_WC.angular}).rotation();
  inertia.X_WG.translation() =
      motion.X_WO * rigid.centre() + kTickSeconds * V_WC.linear - inertia.X_WG.rotation() * rigid.centre();
  constexpr double kPerTick2 = 1.0 / (kTickSeconds * kTickSeconds);
  inertia.stiffness = kPerTick2 * rigid.mass();
  inertia.rotational_tensor_W = kPerTick2 * rigid.inertia(motion.X_WO.rotation());

  MovableBody body;
  body.X_WB = motion.X_WO;
  body.radius = radius;
  body.settled = kFreeSettled;
  body.springs.push_back(inertia);
  return body;
}

/// An island with a free body gets as many sub-steps as its fastest body needs, and nobody in it goes
/// farther than its own speed allows.
void Environment::boundTravel(std::size_t island) noexcept {
  IslandWork& islands = engine_->islands;
  const IslandWork::Island& one = islands.islands()[island];
  double speed = 0.0;
  bool any = false;
  bool meets = false;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    meets = meets || engine_->meets[object.value] != 0;
    if (!flies(object)) continue;
    const Twist& V_WC = engine_->bodies[object.value]->V_WC;
    speed = std::max(speed, fastestPoint(V_WC, engine_->sizes[object.value].radius));
    any = true;
  }
  if (!any) return;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    islands.body(i).reach = speedCap(islands.objectOf(i)) * kTickSeconds;
  }
  SolveLimits& limits = islands.limits(island);
  if (!meets) limits.substep_travel = kNobodyNear;
  const double travel = kSpareTravel * std::min(speed, options_.max_free_speed) * kTickSeconds;
  limits.substeps =
      std::max(kImpactSubsteps, static_cast<std::uint32_t>(std::ceil(travel / limits.substep_travel)));
}

/// The velocity of a free body is the way it has gone. What was pushed out of an overlap shall not fly away:
/// an island moves with the energy it had and what its hands' springs have given, not more.
void Environment::landIsland(std::size_t island) noexcept {
  const IslandWork& islands = engine_->islands;
  const IslandWork::Island& one = islands.islands()[island];
  double given = 0.0;   // [J] by hands
  double before = 0.0;  // [J] of motion
  double after = 0.0;   // [J]
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    const Pose& X_WO = objects_[object.value].X_WO;
    if (!flies(object)) {
      for (const Spring& spring : islands.body(i).springs) {
        given += springEnergy(spring, X_WO) - springEnergy(spring, islands.poseOf(i));
      }
      continue;
    }
    Engine::FreeBody& body = *engine_->bodies[object.value];
    before += body.rigid.energy(X_WO.rotation(), body.V_WC);
    const Displacement way = displacement(X_WO, islands.poseOf(i));
    const Vector3 p_CC = islands.poseOf(i) * body.rigid.centre() - X_WO * body.rigid.centre();
    body.V_WC = {p_CC / kTickSeconds, way.rotation / kTickSeconds};
    after += body.rigid.energy(X_WO.rotation(), body.V_WC);
  }
  const double most = before + std::max(given, 0.0);
  const double share = after > most ? std::sqrt(most / after) : 1.0;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    if (!flies(object)) continue;
    const Engine::FreeBody& body = *engine_->bodies[object.value];
    objects_[object.value].V_WO = atOrigin({share * body.V_WC.linear, share * body.V_WC.angular},
                                           islands.poseOf(i), body.rigid.centre());
  }
}

/// Bodies that have come to rest on something sleep, an island at a time, unless a hand is at one of them.
void Environment::restIsland(std::size_t island) noexcept {
  Engine& engine = *engine_;
  const IslandWork::Island& one = engine.islands.islands()[island];
  bool calm = true;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    engine.at_rest[engine.islands.objectOf(i).value] = 0;
  }
  for (std::size_t slot = one.first_pair; slot < one.first_pair + one.pairs; ++slot) {
    const CollPair& pair = engine.pairs[engine.islands.pairOf(slot)];
    if (!pair.lists()) continue;
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    calm &= flies(a) == flies(b) || !(moves(a) && moves(b));
    if (!pair.touching()) continue;
    engine.at_rest[a.value] = engine.at_rest[b.value] = 1;
  }
  std::uint32_t calm_ticks = kCalmTicks;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!flies(object)) continue;
    const double limit = engine.at_rest[object.value] != 0 ? kCalmSpeed : 0.0;
    const Wrench pushed = engine.forces[object.value].contributed(tick_);
    calm &= speedOf(object) <= limit && pushed.force.isZero(0.0) && pushed.torque.isZero(0.0);
  }
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!flies(object)) continue;
    std::uint32_t& ticks = objects_[object.value].calm_ticks;
    ticks = calm ? ticks + 1 : 0;
    calm_ticks = std::min(calm_ticks, ticks);
  }
  if (calm_ticks < kCalmTicks) return;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!flies(object)) continue;
    engine.movable[object.value] = 0;
    objects_[object.value].asleep = true;
    objects_[object.value].V_WO = Twist{};
  }
}

}  // namespace tenon
