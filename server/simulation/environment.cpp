#include "server/simulation/environment.h"

#include <algorithm>

#include "server/simulation/engine.h"

namespace tenon::simulation {
namespace {

/// [m] Bounding spheres contain the shell points; the surface between them may bulge out by this, per pair.
constexpr double kSphereSlack = 5e-3;

/// [m] Depth from which a pair that begins to collide makes its held objects jump: 0.5 N at 5000 N/m.
constexpr double kOverlap = 1e-4;

}  // namespace

Environment::Environment(std::shared_ptr<const Scene> scene, const EnvironmentOptions& options)
    : scene_(std::move(scene)),
      options_(options),
      objects_(scene_->objects.size()),
      hands_(scene_->hands.size()),
      pairs_(scene_->pairs.size()),
      engine_(std::make_unique<Engine>(*scene_, options)),
      work_limits_(options.work) {
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    objects_[i].X_WO = scene_->objects[i].X_WO;
    objects_[i].status = scene_->objects[i].status;
    // an object is held or tracked through a hand only
    const bool needs_hand =
        objects_[i].status == ObjectStatus::kHeld || objects_[i].status == ObjectStatus::kTracked;
    const bool massless = objects_[i].status == ObjectStatus::kFree && !scene_->objects[i].body;
    if (needs_hand || massless) objects_[i].status = ObjectStatus::kParked;
  }
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    hands_[i].default_object = scene_->hands[i].object;
    hands_[i].object = hands_[i].default_object;
    setHandStiffness(HandId{static_cast<std::uint32_t>(i)}, {});
  }
  for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].enabled = engine_->pairs[i].enabled();
  noteEpochs();
}

Environment::~Environment() = default;

std::string Environment::shareScheduling() { return engine_->pool.shareScheduling(); }

void Environment::setPairEnabled(std::size_t pair, bool enabled) noexcept {
  if (pair >= pairs_.size()) return;
  ++pair_revision_;
  if (enabled && !engine_->pairs[pair].enabled()) engine_->noteSwitched(static_cast<std::uint32_t>(pair));
  engine_->active_pairs -= engine_->countsAsActive(pair) ? 1U : 0U;
  engine_->setEnabled(pair, enabled);
  engine_->active_pairs += engine_->countsAsActive(pair) ? 1U : 0U;
  updatePairMotion(static_cast<std::uint32_t>(pair));
  for (const ObjectId object : {scene_->pairs[pair].a, scene_->pairs[pair].b}) wake(object);
}

void Environment::setGroup(ObjectId object, std::uint32_t group) noexcept {
  if (!isObject(object) || engine_->groups[object.value] == group) return;
  ++pair_revision_;
  for (const std::uint32_t pair : engine_->pairsOf(object.value)) {
    engine_->active_pairs -= engine_->countsAsActive(pair) ? 1U : 0U;
  }
  engine_->groups[object.value] = group;
  for (const std::uint32_t pair : engine_->pairsOf(object.value)) {
    engine_->active_pairs += engine_->countsAsActive(pair) ? 1U : 0U;
    engine_->noteSwitched(pair);
  }
  wake(object);
  wakeNeighbours(object);
}

std::uint32_t Environment::groupOf(ObjectId object) const noexcept {
  return isObject(object) ? engine_->groups[object.value] : 0;
}

void Environment::contribute(ObjectId object, std::uint32_t source, const Wrench& F_Oo_W,
                             std::uint32_t lifetime_ticks) noexcept {
  if (!isObject(object)) return;
  const Wrench F_Oq_W = shifted(F_Oo_W, toCentre(object));
  if (engine_->forces[object.value].contribute(source, F_Oq_W, lifetime_ticks, tick_)) wake(object);
}

void Environment::step() noexcept {
  ++tick_;
  findEmerged();
  declareOverlaps();
  followTrackers();
  limitSharedCouplings();
  findMovable();
  wakeTouchedBodies();
  integrateFreeMotion();
  findReach();
  findNearPairs();
  findDuePairs();
  distributeBudget();
  buildIslands();
  engine_->islands.solve(engine_->pool);
  applyIslandResults();
  queryNonIslandPairs();
  sumForces();
  updateContactFlags();
  countWork();
  for (HandMotion& hand : hands_) hand.X_WH_before = hand.X_WH;
}

/// A held object that lies in another one since inputs let the two collide is pushed out of it: a jump.
void Environment::declareOverlaps() noexcept {
  Engine& engine = *engine_;
  for (const std::uint32_t i : engine.switched) {
    engine.is_switched[i] = 0;
    const CollPair& pair = engine.pairs[i];
    const auto [a, b] = std::pair(pair.spec().a, pair.spec().b);
    if (pair.spec().sensing || !active(i) || (!isPulled(a) && !isPulled(b))) continue;
    const Vector3 p_QaQb_W = objects_[b.value].X_WO * centreOf(b) - objects_[a.value].X_WO * centreOf(a);
    if (p_QaQb_W.norm() > engine.sizes[a.value].ball_radius + engine.sizes[b.value].ball_radius) continue;
    const double gap = pair.findGap(objects_[a.value].X_WO, objects_[b.value].X_WO, kOverlap,
                                    engine.gap_query, engine.feature_scratch[0]);
    if (gap > -kOverlap) continue;
    for (const ObjectId object : {a, b}) {
      // once in a tick: those same inputs may have let it jump already
      const bool has_jumped = objects_[object.value].epoch != engine.epochs[object.value];
      if (isPulled(object) && !has_jumped) beginEpoch(object);
    }
  }
  engine.switched.clear();
  noteEpochs();
}

void Environment::noteEpochs() noexcept {
  for (std::size_t i = 0; i < objects_.size(); ++i) engine_->epochs[i] = objects_[i].epoch;
}

bool Environment::isPulled(ObjectId object) const noexcept {
  for (std::uint32_t i = 0; i < hands_.size(); ++i)
    if (pulls(HandId{i}, object)) return true;
  return false;
}

void Environment::followTrackers() noexcept {
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandMotion& hand = hands_[i];
    if (scene_->hands[i].kind != HandKind::kTracked || !engaged(hand) || hand.frozen) continue;
    if (!isObject(hand.object)) continue;
    ObjectMotion& object = objects_[hand.object.value];
    const Pose X_WO = hand.X_WH * hand.X_HO;
    const Displacement motion = displacement(object.X_WO, X_WO, centreOf(hand.object));
    object.X_WO = X_WO;
    object.V_WO = twistOver(motion, hand.object);
    engine_->addPathLength(hand.object, motion);
    // trackers are not speed-limited: due ticks were computed with the cap and are invalid now
    if (speedOf(hand.object) > speedCap(hand.object)) markDirty(hand.object);
  }
}

bool Environment::active(std::size_t pair) const noexcept {
  const CollPair& one = engine_->pairs[pair];
  const auto collides = [this](ObjectId object) {
    return objects_[object.value].status != ObjectStatus::kHidden && !objects_[object.value].emerging;
  };
  return one.enabled() && one.possible() && !engine_->inOneGroup(pair) && collides(one.spec().a) &&
         collides(one.spec().b);
}

double Environment::speedCap(ObjectId object) const noexcept {
  if (!moves(object)) return 0.0;
  if (isDynamic(object)) return options_.max_free_speed;
  return options_.max_speed + options_.max_turn_rate * engine_->sizes[object.value].radius;
}

/// [m] That no point of the object exceeds in the solve of a tick; trackers have moved theirs before it.
double Environment::travelCap(ObjectId object) const noexcept {
  return engine_->movable[object.value] != 0 ? speedCap(object) * kTickSeconds : 0.0;
}

double Environment::speedOf(ObjectId object) const noexcept {
  const ObjectMotion& motion = objects_[object.value];
  return maxPointSpeed(atCentre(motion.V_WO, motion.X_WO, centreOf(object)),
                       engine_->sizes[object.value].radius);
}

const Vector3& Environment::centreOf(ObjectId object) const noexcept {
  return engine_->sizes[object.value].p_OQ_O;
}

/// [m] p_OQ_W, from the object's origin to its centre.
Vector3 Environment::toCentre(ObjectId object) const noexcept {
  return objects_[object.value].X_WO.rotation() * centreOf(object);
}

/// V_WO at the end of a tick in which the object's centre moved by `motion`.
Twist Environment::twistOver(const Displacement& motion, ObjectId object) const noexcept {
  return atOrigin({motion.translation / kTickSeconds, motion.rotation / kTickSeconds},
                  objects_[object.value].X_WO, centreOf(object));
}

collision::Spring Environment::springOf(HandId hand) const noexcept {
  const HandMotion& motion = hands_[hand.value];
  const HandStiffness stiffness = couplingOf(hand);
  return {motion.X_WH * motion.X_HO, motion.X_HO.inverse().translation(), stiffness.translational,
          stiffness.rotational};
}

collision::MovableBody Environment::movableBody(ObjectId object) noexcept {
  return isDynamic(object) ? freeBody(object) : heldBody(object);
}

collision::MovableBody Environment::heldBody(ObjectId object) const noexcept {
  collision::MovableBody body;
  body.X_WB = objects_[object.value].X_WO;
  body.p_BQ = centreOf(object);
  body.radius = engine_->sizes[object.value].radius;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandId hand{static_cast<std::uint32_t>(i)};
    if (pulls(hand, object)) body.springs.push_back(springOf(hand));
  }
  collision::Spring& first = body.springs[0];
  if (first.stiffness <= 0.0) return body;
  // a constant wrench on the body is equivalent to shifting the goal of a spring by wrench over stiffness
  const Wrench F_Bq_W = engine_->forces[object.value].contributed(tick_);
  const Wrench F_Bc_W = shifted(F_Bq_W, body.X_WB.rotation() * (first.p_BC - body.p_BQ));
  const Vector3 p_WC = first.X_WG * first.p_BC + F_Bc_W.force / first.stiffness;
  if (first.rotational_stiffness > 0.0) {
    const Vector3 rotation = F_Bc_W.torque / first.rotational_stiffness;
    first.X_WG.rotation() = (expRotation(rotation) * first.X_WG.rotation()).normalized();
  }
  first.X_WG.translation() = p_WC - first.X_WG.rotation() * first.p_BC;
  return body;
}

void Environment::findMovable() noexcept {
  std::fill(engine_->movable.begin(), engine_->movable.end(), std::uint8_t{0});
  // a hand that is frozen lets others move what it holds with them; alone it keeps the object at its pose
  for (std::uint32_t i = 0; i < hands_.size(); ++i) {
    const ObjectId object = hands_[i].object;
    if (isObject(object) && pulls(HandId{i}, object)) engine_->movable[object.value] = 1;
  }
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (isDynamic(ObjectId{i})) engine_->movable[i] = 1;
  }
}

void Environment::findNearPairs() noexcept {
  Engine& engine = *engine_;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const ObjectId object{static_cast<std::uint32_t>(i)};
    const ObjectSize& size = engine.sizes[i];
    if (objects_[i].status == ObjectStatus::kHidden || !scene_->objects[i].structures) {
      engine.broad_phase.remove(object);
    } else {
      engine.broad_phase.setSphere(object, objects_[i].X_WO * size.p_OQ_O,
                                   size.ball_radius + 0.5 * kSphereSlack + travelCap(object));
    }
  }
  engine.separated.clear();
  std::swap(engine.separated, engine.near);
  for (const std::uint32_t pair : engine.broad_phase.findPairs(engine.max_margin)) {
    if (active(pair)) engine.near.push_back(pair);
  }
  const auto first_near =
      std::remove_if(engine.separated.begin(), engine.separated.end(), [&engine](std::uint32_t pair) {
        return std::binary_search(engine.near.begin(), engine.near.end(), pair);
      });
  engine.separated.erase(first_near, engine.separated.end());
  for (const std::uint32_t pair : engine.separated) {
    CollPair& one = engine.pairs[pair];
    one.reset();
    engine.contact_lists.release(one.detachList());
    engine.forces[one.spec().a.value].clear(engine.cell_in_a[pair]);
    engine.forces[one.spec().b.value].clear(engine.cell_in_b[pair]);
  }
}

void Environment::findDuePairs() noexcept {
  Engine& engine = *engine_;
  for (const std::uint32_t pair : engine.due) engine.queried[pair] = 0;
  engine.due.clear();
  engine.without_list = 0;
  std::copy(engine.movable.begin(), engine.movable.end(), engine.solved.begin());
  for (const std::uint32_t i : engine.near) {
    CollPair& pair = engine.pairs[i];
    const PairSpec& spec = pair.spec();
    // neither object has moved since the last query: its result is valid
    if (pair.dueTick() == CollPair::kNever) continue;
    if (options_.coherence) {
      const double closing_speed = speedCap(spec.a) + speedCap(spec.b);
      if (!pair.due(tick_)) continue;
      const double reach = engine.largestApproach(travelCap(spec.a), travelCap(spec.b));
      if (pair.postpone(tick_, closing_speed, engine.max_margin, engine.pathLengthOf(spec), reach)) continue;
    }
    if (!pair.hasList()) pair.attachList(engine.contact_lists.acquire());
    if (pair.hasList()) {
      engine.due.push_back(i);
      continue;
    }
    ++engine.without_list;
    if (spec.sensing) continue;
    for (const ObjectId object : {spec.a, spec.b}) {
      if (engine.solved[object.value] != 0) objects_[object.value].V_WO = Twist{};
      engine.solved[object.value] = 0;
    }
  }
}

void Environment::distributeBudget() noexcept {
  Engine& engine = *engine_;
  engine.budget.distribute(work_limits_, engine.due, engine.pairs);
  if (!work_limits_.any()) return;
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    engine.pairs[engine.due[slot]].listTouching(engine.touching[slot]);
  }
}

void Environment::applyIslandResults() noexcept {
  const IslandWork& islands = engine_->islands;
  for (std::size_t island = 0; island < islands.islands().size(); ++island) updateVelocities(island);
  for (std::size_t body = 0; body < islands.bodies(); ++body) {
    ObjectMotion& object = objects_[islands.objectOf(body).value];
    const ObjectId id = islands.objectOf(body);
    const Displacement motion = displacement(object.X_WO, islands.poseOf(body), centreOf(id));
    engine_->addPathLength(id, motion);
    object.X_WO = islands.poseOf(body);
    if (!isDynamic(id)) object.V_WO = twistOver(motion, id);
  }
  for (std::size_t slot = 0; slot < islands.pairs(); ++slot) {
    engine_->pairs[islands.pairOf(slot)].storeSolved(islands.resultOf(slot), tick_);
  }
  for (std::size_t island = 0; island < islands.islands().size(); ++island) updateSleep(island);
}

void Environment::queryNonIslandPairs() noexcept {
  Engine& engine = *engine_;
  engine.non_island.clear();
  const bool limited = work_limits_.any();
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    const std::uint32_t i = engine.due[slot];
    // pairs queried by an island adapt their levels here, the others after their query below
    if (engine.queried[i] != 0) {
      engine.pairs[i].adaptLevels(work_limits_, engine.budget.pointsFor(slot) / kTraversalsPerTick);
    } else {
      engine.non_island.push_back(static_cast<std::uint32_t>(slot));
    }
    engine.queried[i] = 1;
  }
  auto query = [this, limited](unsigned worker, std::size_t item) {
    const std::uint32_t slot = engine_->non_island[item];
    CollPair& pair = engine_->pairs[engine_->due[slot]];
    const std::uint32_t budget = engine_->budget.pointsFor(slot);
    std::span<const std::uint32_t> priority_points;
    if (limited) priority_points = {engine_->touching[slot].begin(), engine_->touching[slot].end()};
    pair.query(objects_[pair.spec().a.value].X_WO, objects_[pair.spec().b.value].X_WO,
               engine_->limits.contact_margin, engine_->feature_scratch[worker], budget, priority_points);
    pair.adaptLevels(work_limits_, budget);
    // sensing pairs exert no force; neither do overlapping objects of which none is tracked
    const bool exerts_force = objects_[pair.spec().a.value].status == ObjectStatus::kTracked ||
                              objects_[pair.spec().b.value].status == ObjectStatus::kTracked;
    if (pair.spec().sensing || !exerts_force) return;
    pair.computePenaltyForce(std::min(scene_->objects[pair.spec().a.value].stiffness,
                                      scene_->objects[pair.spec().b.value].stiffness),
                             objects_[pair.spec().a.value].X_WO);
  };
  engine.pool.run(engine.non_island.size(), query);
  for (const std::uint32_t i : engine.due) {
    CollPair& pair = engine.pairs[i];
    pair.schedule(tick_, speedCap(pair.spec().a) + speedCap(pair.spec().b), engine.max_margin,
                  engine.pathLengthOf(pair.spec()));
  }
}

}  // namespace tenon::simulation
