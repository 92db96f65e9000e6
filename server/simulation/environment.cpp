#include "server/simulation/environment.h"

#include <algorithm>

#include "server/simulation/engine.h"

namespace tenon {
namespace {

/// A shell's ball holds its points; the surface between them bulges a little more: so much for a pair [m].
constexpr double kBallSlack = 5e-3;

/// A pair's walk may take this part of its budget: a tick walks again when a body goes far, looks at the
/// listed points after each sub-step, and may have to come back.
constexpr std::uint32_t kWalksPerTick = 3;

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
    // only a hand makes an object held or tracked
    const bool moved =
        objects_[i].status == ObjectStatus::kHeld || objects_[i].status == ObjectStatus::kTracked;
    const bool massless = objects_[i].status == ObjectStatus::kFree && !scene_->objects[i].body;
    if (moved || massless) objects_[i].status = ObjectStatus::kParked;
  }
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    hands_[i].own = scene_->hands[i].object;
    hands_[i].object = hands_[i].own;
  }
  for (std::size_t i = 0; i < pairs_.size(); ++i) pairs_[i].enabled = engine_->pairs[i].enabled();
}

Environment::~Environment() = default;

void Environment::setPairEnabled(std::size_t pair, bool enabled) noexcept {
  if (pair >= pairs_.size()) return;
  engine_->active_pairs -= engine_->counts(pair) ? 1U : 0U;
  engine_->setEnabled(pair, enabled);
  engine_->active_pairs += engine_->counts(pair) ? 1U : 0U;
  note(static_cast<std::uint32_t>(pair));
  for (const ObjectId object : {scene_->pairs[pair].a, scene_->pairs[pair].b}) wake(object);
}

void Environment::setGroup(ObjectId object, std::uint32_t group) noexcept {
  if (!isObject(object) || engine_->groups[object.value] == group) return;
  for (const std::uint32_t pair : engine_->pairsOf(object.value)) {
    engine_->active_pairs -= engine_->counts(pair) ? 1U : 0U;
  }
  engine_->groups[object.value] = group;
  for (const std::uint32_t pair : engine_->pairsOf(object.value)) {
    engine_->active_pairs += engine_->counts(pair) ? 1U : 0U;
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
  if (engine_->forces[object.value].contribute(source, F_Oo_W, lifetime_ticks, tick_)) wake(object);
}

void Environment::step() noexcept {
  ++tick_;
  followTrackers();
  findMovable();
  wakeWhatIsTouched();
  fly();
  findNearPairs();
  findDuePairs();
  shareWork();
  planIslands();
  engine_->islands.solve(engine_->pool);
  takeIslands();
  lookAtOtherPairs();
  sumForces();
  judgeContacts();
  countWork();
}

void Environment::followTrackers() noexcept {
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandMotion& hand = hands_[i];
    if (scene_->hands[i].kind != HandKind::kTracked || !engaged(hand) || hand.frozen) continue;
    if (!isObject(hand.object)) continue;
    ObjectMotion& object = objects_[hand.object.value];
    const Pose X_WO = hand.X_WH * hand.X_HO;
    const Displacement way = displacement(object.X_WO, X_WO);
    object.X_WO = X_WO;
    object.V_WO = {way.translation / kTickSeconds, way.rotation / kTickSeconds};
    engine_->addTravel(hand.object, way);
    // a tracker keeps no speed limit: what was reckoned with it holds no longer
    if (speedOf(hand.object) > options_.max_speed) stir(hand.object);
  }
}

bool Environment::active(std::size_t pair) const noexcept {
  const CollPair& one = engine_->pairs[pair];
  return one.enabled() && one.possible() && !engine_->grouped(pair) &&
         objects_[one.spec().a.value].status != ObjectStatus::kHidden &&
         objects_[one.spec().b.value].status != ObjectStatus::kHidden;
}

double Environment::speedCap(ObjectId object) const noexcept {
  if (!moves(object)) return 0.0;
  return flies(object) ? options_.max_free_speed : options_.max_speed;
}

double Environment::speedOf(ObjectId object) const noexcept {
  const Twist& V_WO = objects_[object.value].V_WO;
  return fastestPoint(V_WO, engine_->sizes[object.value].radius);
}

Spring Environment::springOf(HandId hand) const noexcept {
  const HandMotion& motion = hands_[hand.value];
  const HandSpec& spec = scene_->hands[hand.value];
  return {motion.X_WH * motion.X_HO, motion.X_HO.inverse().translation(), spec.stiffness,
          spec.rotational_stiffness};
}

MovableBody Environment::movableBody(ObjectId object) noexcept {
  return flies(object) ? freeBody(object) : heldBody(object);
}

MovableBody Environment::heldBody(ObjectId object) const noexcept {
  MovableBody body;
  body.X_WB = objects_[object.value].X_WO;
  body.radius = engine_->sizes[object.value].radius;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandId hand{static_cast<std::uint32_t>(i)};
    const bool coupled = scene_->hands[i].kind == HandKind::kCoupled;
    if (coupled && engaged(hands_[i]) && hands_[i].object == object) body.springs.push_back(springOf(hand));
  }
  Spring& first = body.springs[0];
  if (first.stiffness <= 0.0) return body;
  // a constant wrench on the body is the same energy as a goal farther on
  const Wrench F_Bo_W = engine_->forces[object.value].contributed(tick_);
  const Wrench F_Bc_W = shifted(F_Bo_W, body.X_WB.rotation() * first.p_BC);
  const Vector3 p_WC = first.X_WG * first.p_BC + F_Bc_W.force / first.stiffness;
  if (first.rotational_stiffness > 0.0) {
    const Vector3 turn = F_Bc_W.torque / first.rotational_stiffness;
    first.X_WG.rotation() = (expRotation(turn) * first.X_WG.rotation()).normalized();
  }
  first.X_WG.translation() = p_WC - first.X_WG.rotation() * first.p_BC;
  return body;
}

void Environment::findMovable() noexcept {
  std::fill(engine_->movable.begin(), engine_->movable.end(), std::uint8_t{0});
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandMotion& hand = hands_[i];
    if (scene_->hands[i].kind == HandKind::kCoupled && engaged(hand) && isObject(hand.object)) {
      engine_->movable[hand.object.value] = 1;
    }
  }
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (flies(ObjectId{i})) engine_->movable[i] = 1;
  }
  // one frozen hand holds it still, whoever else pulls
  for (const HandMotion& hand : hands_) {
    if (isObject(hand.object) && engaged(hand) && hand.frozen) engine_->movable[hand.object.value] = 0;
  }
}

void Environment::findNearPairs() noexcept {
  Engine& engine = *engine_;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const ObjectId object{static_cast<std::uint32_t>(i)};
    const ObjectSize& size = engine.sizes[i];
    if (objects_[i].status == ObjectStatus::kHidden || !scene_->objects[i].structures) {
      engine.broad_phase.hide(object);
    } else {
      const double faster = flies(object) ? options_.max_free_speed - options_.max_speed : 0.0;
      engine.broad_phase.place(object, objects_[i].X_WO * size.p_OC_O,
                               size.ball + 0.5 * kBallSlack + std::max(faster, 0.0) * kTickSeconds);
    }
  }
  // from the poses alone, so that skipping a look can never change who is solved with whom
  const double reach = engine.reach + 2.0 * options_.max_speed * kTickSeconds;
  engine.left.clear();
  std::swap(engine.left, engine.near);
  for (const std::uint32_t pair : engine.broad_phase.find(reach)) {
    if (active(pair)) engine.near.push_back(pair);
  }
  const auto gone = std::remove_if(engine.left.begin(), engine.left.end(), [&engine](std::uint32_t pair) {
    return std::binary_search(engine.near.begin(), engine.near.end(), pair);
  });
  engine.left.erase(gone, engine.left.end());
  for (const std::uint32_t pair : engine.left) {
    CollPair& one = engine.pairs[pair];
    one.forget();
    engine.rooms.giveBack(one.moveOut());
    engine.forces[one.spec().a.value].clear(engine.cell_in_a[pair]);
    engine.forces[one.spec().b.value].clear(engine.cell_in_b[pair]);
  }
}

void Environment::findDuePairs() noexcept {
  Engine& engine = *engine_;
  for (const std::uint32_t pair : engine.due) engine.looked_at[pair] = 0;
  engine.due.clear();
  engine.refused = 0;
  std::copy(engine.movable.begin(), engine.movable.end(), engine.solved.begin());
  for (const std::uint32_t i : engine.near) {
    CollPair& pair = engine.pairs[i];
    const PairSpec& spec = pair.spec();
    // two that rest do not change what was found
    if (pair.dueTick() == CollPair::kNever) continue;
    if (options_.coherence) {
      const double closing_speed = speedCap(spec.a) + speedCap(spec.b);
      if (!pair.due(tick_)) continue;
      if (pair.putOff(tick_, closing_speed, engine.reach, engine.travelledBy(spec))) continue;
    }
    if (!pair.hasRoom()) pair.moveIn(engine.rooms.take());
    if (pair.hasRoom()) {
      engine.due.push_back(i);
      continue;
    }
    ++engine.refused;
    if (spec.sensing) continue;
    for (const ObjectId object : {spec.a, spec.b}) {
      if (engine.solved[object.value] != 0) objects_[object.value].V_WO = Twist{};
      engine.solved[object.value] = 0;
    }
  }
}

void Environment::shareWork() noexcept {
  Engine& engine = *engine_;
  engine.budget.share(work_limits_, engine.due, engine.pairs);
  if (!work_limits_.any()) return;
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    engine.pairs[engine.due[slot]].listTouching(engine.touching[slot]);
  }
}

void Environment::planIslands() noexcept {
  Engine& engine = *engine_;
  engine.partition.begin(engine.solved);
  std::fill(engine.meets.begin(), engine.meets.end(), std::uint8_t{0});
  for (const std::uint32_t i : engine.near) {
    const PairSpec& spec = engine.pairs[i].spec();
    if (spec.sensing) continue;
    engine.partition.join(spec.a, spec.b);
    engine.meets[spec.a.value] = engine.meets[spec.b.value] = 1;
  }
  engine.partition.number();
  engine.islands.clear();
  for (std::size_t i = 0; i < engine.partition.count(); ++i) addIsland(static_cast<std::int32_t>(i));
}

void Environment::addIsland(std::int32_t island) noexcept {
  Engine& engine = *engine_;
  engine.islands.beginIsland(engine.limits);
  double speed = 0.0;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const ObjectId object{static_cast<std::uint32_t>(i)};
    if (engine.partition.islandOf(object) != island) continue;
    engine.islands.addBody(object, movableBody(object));
    speed = std::max(speed, speedOf(object));
  }
  engine.islands.widenMargin(std::min(speed * kLookAheadTicks * kTickSeconds, kLookAheadReach));
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    const std::uint32_t i = engine.due[slot];
    const CollPair& pair = engine.pairs[i];
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    const std::int32_t island_a = engine.partition.islandOf(a);
    const std::int32_t island_b = engine.partition.islandOf(b);
    if (pair.spec().sensing || (island_a != island && island_b != island)) continue;
    IslandPair one = pair.islandPair(objects_[a.value].X_WO, objects_[b.value].X_WO, tick_);
    // farther away, coherence decides when a pair is looked at, and must not decide what it lists
    if (pair.gap() > engine.reach) one.last = nullptr;
    one.body_a = island_a == island ? engine.partition.placeOf(a) : GapRow::kStatic;
    one.body_b = island_b == island ? engine.partition.placeOf(b) : GapRow::kStatic;
    if (work_limits_.any()) {
      one.levels = pair.levels();
      one.budget = engine.budget.of(slot) / kWalksPerTick;
      one.first = {engine.touching[slot].begin(), engine.touching[slot].end()};
      engine.islands.addPoints(engine.budget.of(slot));
    }
    engine.islands.addPair(i, one);
    engine.looked_at[i] = 1;
  }
  boundTravel(static_cast<std::size_t>(island));
}

void Environment::takeIslands() noexcept {
  const IslandWork& islands = engine_->islands;
  for (std::size_t island = 0; island < islands.islands().size(); ++island) landIsland(island);
  for (std::size_t body = 0; body < islands.bodies(); ++body) {
    ObjectMotion& object = objects_[islands.objectOf(body).value];
    const Displacement way = displacement(object.X_WO, islands.poseOf(body));
    engine_->addTravel(islands.objectOf(body), way);
    object.X_WO = islands.poseOf(body);
    if (!flies(islands.objectOf(body))) {
      object.V_WO = {way.translation / kTickSeconds, way.rotation / kTickSeconds};
    }
  }
  for (std::size_t slot = 0; slot < islands.pairs(); ++slot) {
    engine_->pairs[islands.pairOf(slot)].take(islands.resultOf(slot), tick_);
  }
  for (std::size_t island = 0; island < islands.islands().size(); ++island) restIsland(island);
}

void Environment::lookAtOtherPairs() noexcept {
  Engine& engine = *engine_;
  engine.others.clear();
  const bool limited = work_limits_.any();
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    const std::uint32_t i = engine.due[slot];
    // what an island has looked at chooses its levels here, the others after their look
    if (engine.looked_at[i] != 0) {
      engine.pairs[i].adapt(work_limits_, engine.budget.of(slot) / kWalksPerTick);
    } else {
      engine.others.push_back(static_cast<std::uint32_t>(slot));
    }
    engine.looked_at[i] = 1;
  }
  auto look = [this, limited](unsigned, std::size_t item) {
    const std::uint32_t slot = engine_->others[item];
    CollPair& pair = engine_->pairs[engine_->due[slot]];
    const std::uint32_t budget = engine_->budget.of(slot);
    std::span<const std::uint32_t> first;
    if (limited) first = {engine_->touching[slot].begin(), engine_->touching[slot].end()};
    pair.query(objects_[pair.spec().a.value].X_WO, objects_[pair.spec().b.value].X_WO,
               engine_->limits.contact_margin, budget, first);
    pair.adapt(work_limits_, budget);
    // what only senses overlaps without pressing, and of two that stand still nobody presses the other
    const bool presses = objects_[pair.spec().a.value].status == ObjectStatus::kTracked ||
                         objects_[pair.spec().b.value].status == ObjectStatus::kTracked;
    if (pair.spec().sensing || !presses) return;
    pair.press(std::min(scene_->objects[pair.spec().a.value].stiffness,
                        scene_->objects[pair.spec().b.value].stiffness),
               objects_[pair.spec().a.value].X_WO);
  };
  engine.pool.run(engine.others.size(), look);
  for (const std::uint32_t i : engine.due) {
    CollPair& pair = engine.pairs[i];
    pair.schedule(tick_, speedCap(pair.spec().a) + speedCap(pair.spec().b), engine.reach,
                  engine.travelledBy(pair.spec()));
  }
}

}  // namespace tenon
