#include <algorithm>

#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {
namespace {

/// [m] How far any point of a body may go in a tick beside the motion of its hand or its velocity: pushed, in
/// a turn about a contact, or back to its hand. So a force falls by at most 1 N a tick at 1000 N/m.
constexpr double kSpareReach = 1e-3;

}  // namespace

/// [m] How far any point of a movable body moves in this tick by the motion of its hand, or by its inertia.
double Environment::ownWay(ObjectId object) noexcept {
  const double radius = engine_->sizes[object.value].radius;
  if (isDynamic(object)) return kTickSeconds * maxPointSpeed(twistOfCentre(object), radius);
  const HandMotion* holder = nullptr;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const HandMotion& hand = hands_[i];
    if (!pulls(HandId{static_cast<std::uint32_t>(i)}, object)) continue;
    // hands in opposite directions turn the object by more than any of them moves
    if (holder != nullptr) return travelCap(object);
    holder = &hand;
  }
  if (holder == nullptr) return 0.0;
  const Displacement motion =
      displacement(holder->X_WH_before * holder->X_HO, holder->X_WH * holder->X_HO, centreOf(object));
  return maxPointMotion(motion, radius);
}

void Environment::findReach() noexcept {
  Engine& engine = *engine_;
  engine.largest_reach = 0.0;
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    const ObjectId object{i};
    engine.reach[i] = 0.0;
    if (engine.movable[i] == 0) continue;
    engine.reach[i] = std::min(ownWay(object) + kSpareReach, travelCap(object));
    engine.largest_reach = std::max(engine.largest_reach, engine.reach[i]);
  }
}

/// Lists the near pairs of two bodies that are both solved for, with their gaps. These are functions of the
/// poses and of the last solve: coherence cannot change which bodies form an island.
void Environment::findNeighbours() noexcept {
  Engine& engine = *engine_;
  engine.neighbours.clear();
  engine.gap_points = 0;
  for (const std::uint32_t i : engine.near) {
    const CollPair& pair = engine.pairs[i];
    const auto [a, b] = std::pair(pair.spec().a, pair.spec().b);
    if (pair.spec().sensing || engine.solved[a.value] == 0 || engine.solved[b.value] == 0) continue;
    const bool touches = pair.solvedBefore(tick_) != nullptr && pair.gap() <= kSpareReach;
    double gap = pair.gap();
    if (!touches) {
      gap = pair.findGap(objects_[a.value].X_WO, objects_[b.value].X_WO,
                         engine.largestApproach(travelCap(a), travelCap(b)), engine.gap_query,
                         engine.feature_scratch[0]);
      engine.gap_points += engine.gap_query.counts.points_visited;
    }
    engine.neighbours.push_back({a, b, gap});
  }
}

/// [m] At most how far any point of a body goes in this tick, as a member of its island.
double Environment::reachOf(ObjectId object) noexcept {
  return std::min(engine_->reach[engine_->partition.leaderOf(object).value], travelCap(object));
}

/// Bodies that may meet in this tick are in one island: what one of them does may push the others as far.
void Environment::buildIslands() noexcept {
  Engine& engine = *engine_;
  engine.partition.reset(engine.solved);
  findNeighbours();
  for (bool more = true; more;) {
    more = false;
    for (const auto& [a, b, gap] : engine.neighbours) {
      const std::uint32_t one = engine.partition.leaderOf(a).value;
      const std::uint32_t other = engine.partition.leaderOf(b).value;
      if (one == other || gap > reachOf(a) + reachOf(b)) continue;
      engine.partition.join(a, b);
      engine.reach[std::min(one, other)] = std::max(engine.reach[one], engine.reach[other]);
      more = true;
    }
  }
  engine.partition.assignIslands();
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
  engine.islands.widenMargin(std::min(speed * kLookAheadTicks * kTickSeconds, kMaxLookAhead));
  for (std::size_t slot = 0; slot < engine.due.size(); ++slot) {
    const std::uint32_t i = engine.due[slot];
    const CollPair& pair = engine.pairs[i];
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    const std::int32_t island_a = engine.partition.islandOf(a);
    const std::int32_t island_b = engine.partition.islandOf(b);
    if (pair.spec().sensing || (island_a != island && island_b != island)) continue;
    // two islands that cannot meet in this tick
    const bool apart = island_a != IslandPartition::kNone && island_b != IslandPartition::kNone;
    if (apart && island_a != island_b) continue;
    collision::IslandPair one = pair.islandPair(objects_[a.value].X_WO, objects_[b.value].X_WO, tick_);
    // at larger gaps the tick of the last query depends on coherence, and results must not: no warm start
    if (pair.gap() > engine.max_margin) one.last = nullptr;
    one.body_a = island_a == island ? engine.partition.bodyIndexOf(a) : collision::ContactConstraint::kStatic;
    one.body_b = island_b == island ? engine.partition.bodyIndexOf(b) : collision::ContactConstraint::kStatic;
    if (work_limits_.any()) {
      one.levels = pair.levels();
      one.budget = engine.budget.pointsFor(slot) / kTraversalsPerTick;
      one.priority_points = {engine.touching[slot].begin(), engine.touching[slot].end()};
      engine.islands.addPointBudget(engine.budget.pointsFor(slot));
    }
    engine.islands.addPair(i, one);
    engine.queried[i] = 1;
  }
  setStepLimits(static_cast<std::size_t>(island));
}

}  // namespace tenon::simulation
