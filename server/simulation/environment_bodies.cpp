#include <algorithm>
#include <cmath>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// [m/s] A body in contact is put to sleep after kSleepTicks below this speed: too slow to be seen, and a
/// body that starts to fall exceeds it within that time.
constexpr double kSleepSpeed = 2e-3;
constexpr std::uint32_t kSleepTicks = 30;

/// [m] Convergence tolerance of a free body: smaller than for held ones, so that the smallest force moves it.
constexpr double kFreeBodyTolerance = 1e-9;

/// SQP steps that an island with free bodies may make, at least: an unconverged tick would lose momentum.
constexpr std::uint32_t kMinImpactSteps = 10;

/// [-] Length of all SQP steps of a fast body over its displacement: reserve for a deflection at a contact.
constexpr double kSpareTravel = 1.25;

}  // namespace

bool Environment::isDynamic(ObjectId object) const noexcept {
  return objects_[object.value].status == ObjectStatus::kFree && !objects_[object.value].asleep &&
         !free_bodies_paused_;
}

void Environment::setFreeBodiesPaused(bool paused) noexcept {
  if (free_bodies_paused_ == paused) return;
  free_bodies_paused_ = paused;
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].status != ObjectStatus::kFree || objects_[i].asleep) continue;
    objects_[i].V_WO = Twist{};
    markDirty(ObjectId{i});
  }
}

bool Environment::moves(ObjectId object) const noexcept {
  return engine_->movable[object.value] != 0 || objects_[object.value].status == ObjectStatus::kTracked;
}

void Environment::wake(ObjectId object) noexcept {
  ObjectMotion& motion = objects_[object.value];
  motion.rest_ticks = 0;
  if (!motion.asleep) return;
  motion.asleep = false;
  markDirty(object);
}

void Environment::wakeNeighbours(ObjectId object) noexcept {
  for (const std::uint32_t i : engine_->near) {
    const PairSpec& spec = engine_->pairs[i].spec();
    if (spec.a == object) wake(spec.b);
    if (spec.b == object) wake(spec.a);
  }
}

/// Whether a sleeping body of the pair has to be woken when the other one moves. After an island solve any
/// listed contact counts, also one ahead, so that a body is awake before it is hit. Other results count up to
/// the contact margin: whether they list more depends on coherence.
bool Environment::mayTouch(std::size_t pair) const noexcept {
  const CollPair& one = engine_->pairs[pair];
  return one.solvedBefore(tick_) != nullptr ||
         (one.hasContacts() && one.gap() <= engine_->limits.contact_margin);
}

/// Wakes bodies in contact with a moving object, and then those in contact with a woken one.
void Environment::wakeTouchedBodies() noexcept {
  bool more =
      std::any_of(objects_.begin(), objects_.end(), [](const ObjectMotion& one) { return one.asleep; });
  for (std::size_t pass = 0; more && pass < objects_.size(); ++pass) {
    more = false;
    for (const std::uint32_t i : engine_->near) {
      const CollPair& pair = engine_->pairs[i];
      if (pair.spec().sensing || !active(i) || !mayTouch(i)) continue;
      for (const auto& [one, other] :
           {std::pair(pair.spec().a, pair.spec().b), std::pair(pair.spec().b, pair.spec().a)}) {
        if (!objects_[other.value].asleep || !moves(one)) continue;
        wake(other);
        if (isDynamic(other)) engine_->movable[other.value] = 1;  // not while free bodies are paused
        more = true;
      }
    }
  }
}

/// Predicts the velocities of all free bodies at the end of the tick: no contacts, but friction.
void Environment::integrateFreeMotion() noexcept {
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (!isDynamic(ObjectId{i})) continue;
    Engine::FreeBody& body = *engine_->bodies[i];
    const Pose& X_WO = objects_[i].X_WO;
    const Wrench F_Oq_W = engine_->forces[i].contributed(tick_);
    body.V_WC = body.rigid.integrateVelocity(
        X_WO.rotation(), atCentre(objects_[i].V_WO, X_WO, body.rigid.centre()),
        shifted(F_Oq_W, X_WO.rotation() * (body.rigid.centre() - centreOf(ObjectId{i}))));
    body.inverse_inertia_W = body.rigid.inertia(X_WO.rotation()).inverse();
  }
  applyFreeBodyFriction();
}

/// Predicted twist of a free body's centre Q: its centre of mass is elsewhere.
Twist Environment::twistOfCentre(ObjectId object) const noexcept {
  const Engine::FreeBody& body = *engine_->bodies[object.value];
  return atCentre(body.V_WC, objects_[object.value].X_WO, centreOf(object) - body.rigid.centre());
}

/// The free body as the island solver needs it: a spring of stiffness M / dt^2 towards its predicted pose.
collision::MovableBody Environment::freeBody(ObjectId object) noexcept {
  const ObjectMotion& motion = objects_[object.value];
  const RigidBody& rigid = engine_->bodies[object.value]->rigid;
  Twist& V_WC = engine_->bodies[object.value]->V_WC;
  const double radius = engine_->sizes[object.value].radius;
  const double speed = maxPointSpeed(twistOfCentre(object), radius);
  if (speed > options_.max_free_speed) {
    V_WC.linear *= options_.max_free_speed / speed;
    V_WC.angular *= options_.max_free_speed / speed;
  }

  collision::Spring inertia;
  inertia.p_BC = rigid.centre();
  inertia.X_WG.rotation() = displaced(motion.X_WO, {Vector3::Zero(), kTickSeconds * V_WC.angular}).rotation();
  inertia.X_WG.translation() =
      motion.X_WO * rigid.centre() + kTickSeconds * V_WC.linear - inertia.X_WG.rotation() * rigid.centre();
  constexpr double kPerTick2 = 1.0 / (kTickSeconds * kTickSeconds);
  inertia.stiffness = kPerTick2 * rigid.mass();
  inertia.rotational_tensor_W = kPerTick2 * rigid.inertia(motion.X_WO.rotation());

  collision::MovableBody body;
  body.X_WB = motion.X_WO;
  body.p_BQ = centreOf(object);
  body.radius = radius;
  body.tolerance = kFreeBodyTolerance;
  body.springs.push_back(inertia);
  return body;
}

/// Limits the travel of each body of an island by its reach, and sets the number of SQP steps of an island
/// with free bodies for its fastest one.
void Environment::setStepLimits(std::size_t island) noexcept {
  IslandWork& islands = engine_->islands;
  const IslandWork::Island& one = islands.islands()[island];
  double speed = 0.0;
  bool any_free = false;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    islands.body(i).max_displacement = reachOf(object);
    if (!isDynamic(object)) continue;
    speed = std::max(speed, maxPointSpeed(twistOfCentre(object), engine_->sizes[object.value].radius));
    any_free = true;
  }
  if (!any_free) return;
  collision::SolveLimits& limits = islands.limits(island);
  const double travel = kSpareTravel * std::min(speed, options_.max_free_speed) * kTickSeconds;
  limits.max_steps =
      std::max(kMinImpactSteps, static_cast<std::uint32_t>(std::ceil(travel / limits.max_step_length)));
}

/// The velocity of a free body is its displacement per tick. Bodies pushed out of an overlap must not gain
/// energy: velocities of an island are scaled so that its kinetic energy is at most what it was predicted to
/// be plus the work of the couplings.
void Environment::updateVelocities(std::size_t island) noexcept {
  const IslandWork& islands = engine_->islands;
  const IslandWork::Island& one = islands.islands()[island];
  double work = 0.0;    // [J] of the couplings
  double before = 0.0;  // [J] predicted kinetic energy
  double after = 0.0;   // [J] kinetic energy
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    const Pose& X_WO = objects_[object.value].X_WO;
    if (!isDynamic(object)) {
      for (const collision::Spring& spring : islands.body(i).springs) {
        work += collision::springEnergy(spring, X_WO) - collision::springEnergy(spring, islands.poseOf(i));
      }
      continue;
    }
    Engine::FreeBody& body = *engine_->bodies[object.value];
    before += body.rigid.energy(X_WO.rotation(), body.V_WC);
    const Displacement motion = displacement(X_WO, islands.poseOf(i));
    const Vector3 p_CC_W = islands.poseOf(i) * body.rigid.centre() - X_WO * body.rigid.centre();
    body.V_WC = {p_CC_W / kTickSeconds, motion.rotation / kTickSeconds};
    after += body.rigid.energy(X_WO.rotation(), body.V_WC);
  }
  const double max_energy = before + std::max(work, 0.0);
  const double scale = after > max_energy ? std::sqrt(max_energy / after) : 1.0;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = islands.objectOf(i);
    if (!isDynamic(object)) continue;
    const Engine::FreeBody& body = *engine_->bodies[object.value];
    objects_[object.value].V_WO = atOrigin({scale * body.V_WC.linear, scale * body.V_WC.angular},
                                           islands.poseOf(i), body.rigid.centre());
  }
}

/// Puts the free bodies of an island to sleep together when all of them are at rest in contact and none has a
/// contact with a moving kinematic or held object.
void Environment::updateSleep(std::size_t island) noexcept {
  Engine& engine = *engine_;
  const IslandWork::Island& one = engine.islands.islands()[island];
  bool at_rest = true;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    engine.has_contact[engine.islands.objectOf(i).value] = 0;
  }
  for (std::size_t slot = one.first_pair; slot < one.first_pair + one.pairs; ++slot) {
    const CollPair& pair = engine.pairs[engine.islands.pairOf(slot)];
    if (!pair.hasContacts()) continue;
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    at_rest &= isDynamic(a) == isDynamic(b) || !(moves(a) && moves(b));
    if (!pair.touching()) continue;
    engine.has_contact[a.value] = engine.has_contact[b.value] = 1;
  }
  std::uint32_t rest_ticks = kSleepTicks;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!isDynamic(object)) continue;
    const double limit = engine.has_contact[object.value] != 0 ? kSleepSpeed : 0.0;
    const Wrench contributed = engine.forces[object.value].contributed(tick_);
    at_rest &= speedOf(object) <= limit && contributed.force.isZero(0.0) && contributed.torque.isZero(0.0);
  }
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!isDynamic(object)) continue;
    std::uint32_t& ticks = objects_[object.value].rest_ticks;
    ticks = at_rest ? ticks + 1 : 0;
    rest_ticks = std::min(rest_ticks, ticks);
  }
  if (rest_ticks < kSleepTicks) return;
  for (std::size_t i = one.first_body; i < one.first_body + one.bodies; ++i) {
    const ObjectId object = engine.islands.objectOf(i);
    if (!isDynamic(object)) continue;
    engine.movable[object.value] = 0;
    objects_[object.value].asleep = true;
    objects_[object.value].V_WO = Twist{};
  }
}

}  // namespace tenon::simulation
