#include <algorithm>

#include "server/collision/motion_solver.h"
#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon::simulation {

void Environment::sumForces() noexcept {
  Engine& engine = *engine_;
  for (const std::uint32_t i : engine.near) {
    const CollPair& pair = engine.pairs[i];
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    if (!pair.hasContacts()) {
      engine.forces[a.value].clear(engine.cell_in_a[i]);
      engine.forces[b.value].clear(engine.cell_in_b[i]);
    } else if (engine.queried[i] != 0) {
      const Wrench F_Aq_W = shifted(pair.result()->F_Ao_W, toCentre(a));
      const Vector3 p_QaQb_W = objects_[b.value].X_WO * centreOf(b) - objects_[a.value].X_WO * centreOf(a);
      engine.forces[a.value].write(engine.cell_in_a[i], F_Aq_W, tick_);
      engine.forces[b.value].write(engine.cell_in_b[i], -shifted(F_Aq_W, p_QaQb_W), tick_);
    }
  }
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    HandMotion& hand = hands_[i];
    hand.F_Ho_W = Wrench{};
    const HandId id{static_cast<std::uint32_t>(i)};
    if (!isObject(hand.object) || !engaged(hand)) continue;
    const std::size_t object = hand.object.value;
    const Pose& X_WO = objects_[object].X_WO;
    const Vector3 p_QH_W = hand.X_WH.translation() - X_WO * centreOf(hand.object);
    if (pulls(id, hand.object)) {
      const Wrench F_Oq_W = shifted(collision::springWrench(springOf(id), X_WO), toCentre(hand.object));
      engine.forces[object].write(engine.couplingCell(hand.object, id), F_Oq_W, tick_);
      hand.F_Ho_W = -shifted(F_Oq_W, p_QH_W);
    } else if (scene_->hands[i].kind == HandKind::kTracked) {
      hand.F_Ho_W = shifted(engine.forces[object].total(tick_), p_QH_W);
    } else {
      engine.forces[object].clear(engine.couplingCell(hand.object, id));
    }
  }
  writeGravity();
  for (ForceBuffer& buffer : engine.forces) buffer.expire(tick_);
}

void Environment::writeGravity() noexcept {
  Engine& engine = *engine_;
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    if (!engine.bodies[i]) continue;
    const ObjectId object{i};
    const RigidBody& rigid = engine.bodies[i]->rigid;
    if (objects_[i].status != ObjectStatus::kFree) {
      engine.forces[i].clear(engine.gravityCell(object));
      continue;
    }
    const Vector3 p_QC_W = objects_[i].X_WO.rotation() * (rigid.centre() - centreOf(object));
    engine.forces[i].write(engine.gravityCell(object), {rigid.weight(), p_QC_W.cross(rigid.weight())}, tick_);
  }
}

void Environment::updateContactFlags() noexcept {
  for (ObjectMotion& object : objects_) object.in_contact = false;
  for (const std::uint32_t i : engine_->near) {
    const CollPair& pair = engine_->pairs[i];
    if (!pair.touching()) continue;
    // in a sensing pair only the tracked object counts as in contact
    ObjectMotion& a = objects_[pair.spec().a.value];
    ObjectMotion& b = objects_[pair.spec().b.value];
    a.in_contact |= !pair.spec().sensing || a.status == ObjectStatus::kTracked;
    b.in_contact |= !pair.spec().sensing || b.status == ObjectStatus::kTracked;
  }
}

void Environment::updatePairMotion(std::uint32_t pair) noexcept {
  const CollPair& one = engine_->pairs[pair];
  pairs_[pair] = {one.enabled(), engine_->queried[pair] != 0, one.skippedLevels(), one.dueTick(),
                  one.result()};
}

void Environment::countActivePairs() noexcept {
  Engine& engine = *engine_;
  const auto countOf = [&engine](std::size_t object) {
    const auto pairs = engine.pairsOf(object);
    return static_cast<std::uint32_t>(
        std::count_if(pairs.begin(), pairs.end(), [&](std::uint32_t i) { return engine.countsAsActive(i); }));
  };
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const std::uint8_t hidden = objects_[i].status == ObjectStatus::kHidden ? 1 : 0;
    if (hidden == engine.hidden[i]) continue;
    engine.active_pairs -= countOf(i);
    engine.hidden[i] = hidden;
    engine.active_pairs += countOf(i);
  }
  if (!engine.recount) return;
  engine.recount = false;
  engine.active_pairs = 0;
  for (std::size_t i = 0; i < pairs_.size(); ++i) engine.active_pairs += engine.countsAsActive(i) ? 1U : 0U;
}

void Environment::countWork() noexcept {
  Engine& engine = *engine_;
  countActivePairs();
  work_ = Work{};
  work_.active_pairs = engine.active_pairs;
  work_.near_pairs = static_cast<std::uint32_t>(engine.near.size());
  work_.queried_pairs = static_cast<std::uint32_t>(engine.due.size());
  work_.deferred_pairs = engine.without_list;
  work_.points_visited = engine.gap_points;
  for (const std::uint32_t i : engine.separated) updatePairMotion(i);
  for (const std::uint32_t i : engine.near) {
    CollPair& pair = engine.pairs[i];
    if (!pair.hasContacts()) engine.contact_lists.release(pair.detachList());
    updatePairMotion(i);
    if (engine.queried[i] == 0) continue;
    work_.load_percent = std::max(work_.load_percent, pair.counts().loadPercent());
    work_.limited_pairs += pair.skippedLevels() > 0 ? 1U : 0U;
    work_.contacts_dropped += pair.counts().contacts_dropped;
  }
  for (const std::uint32_t slot : engine.non_island) {
    work_.points_visited += engine.pairs[engine.due[slot]].counts().points_visited;
  }
  for (const IslandWork::Island& island : engine.islands.islands()) {
    work_.steps += island.report.steps;
    work_.iterations += island.report.iterations;
    work_.points_visited += island.report.points_visited;
    work_.solve_work += island.report.work;
    work_.limited_islands += island.report.work_limited ? 1U : 0U;
    work_.infeasible |= island.report.infeasible;
  }
}

}  // namespace tenon::simulation
