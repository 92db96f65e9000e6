#include <algorithm>

#include "server/collision/motion_solver.h"
#include "server/simulation/engine.h"
#include "server/simulation/environment.h"

namespace tenon {

void Environment::sumForces() noexcept {
  Engine& engine = *engine_;
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    CollPair& pair = engine.pairs[i];
    const ObjectId a = pair.spec().a;
    const ObjectId b = pair.spec().b;
    if (pair.result() == nullptr) {
      engine.forces[a.value].clear(engine.cell_in_a[i]);
      engine.forces[b.value].clear(engine.cell_in_b[i]);
    } else if (engine.looked_at[i] != 0) {
      const Wrench F_Ao_W = pair.result()->F_Ao_W;
      const Vector3 p_AB_W = objects_[b.value].X_WO.translation() - objects_[a.value].X_WO.translation();
      engine.forces[a.value].write(engine.cell_in_a[i], F_Ao_W, tick_);
      engine.forces[b.value].write(engine.cell_in_b[i], -shifted(F_Ao_W, p_AB_W), tick_);
    }
  }
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    HandMotion& hand = hands_[i];
    hand.F_Ho_W = Wrench{};
    const HandId id{static_cast<std::uint32_t>(i)};
    if (!isObject(hand.object) || !engaged(hand)) continue;
    const std::size_t object = hand.object.value;
    const Pose& X_WO = objects_[object].X_WO;
    const Vector3 p_OH_W = hand.X_WH.translation() - X_WO.translation();
    if (engine.movable[object] != 0) {
      const Wrench F_Oo_W = springWrench(springOf(id), X_WO);
      engine.forces[object].write(engine.couplingCell(hand.object, id), F_Oo_W, tick_);
      hand.F_Ho_W = -shifted(F_Oo_W, p_OH_W);
    } else if (scene_->hands[i].kind == HandKind::kTracked) {
      hand.F_Ho_W = shifted(engine.forces[object].total(tick_), p_OH_W);
    } else {
      engine.forces[object].clear(engine.couplingCell(hand.object, id));
    }
  }
  for (ForceBuffer& buffer : engine.forces) buffer.expire(tick_);
}

void Environment::judgeContacts() noexcept {
  for (ObjectMotion& object : objects_) object.in_contact = false;
  for (const CollPair& pair : engine_->pairs) {
    if (!pair.touching()) continue;
    // what only senses leaves no mark on what it touches
    ObjectMotion& a = objects_[pair.spec().a.value];
    ObjectMotion& b = objects_[pair.spec().b.value];
    a.in_contact |= !pair.spec().sensing || a.status == ObjectStatus::kTracked;
    b.in_contact |= !pair.spec().sensing || b.status == ObjectStatus::kTracked;
  }
}

void Environment::countWork() noexcept {
  work_ = Work{};
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const CollPair& pair = engine_->pairs[i];
    const bool queried = engine_->looked_at[i] != 0;
    pairs_[i] = {pair.enabled(), queried, pair.dueTick(), pair.result()};
    work_.active_pairs += active(i) ? 1U : 0U;
    if (!queried) continue;
    ++work_.queried_pairs;
    work_.load_percent = std::max(work_.load_percent, pair.result()->query.counts.loadPercent());
  }
  for (std::size_t i = 0; i < engine_->other_count; ++i) {
    work_.points_visited += engine_->pairs[engine_->others[i]].result()->query.counts.points_visited;
  }
  for (const IslandWork::Island& island : engine_->islands.islands()) {
    work_.substeps += island.report.substeps;
    work_.iterations += island.report.iterations;
    work_.points_visited += island.report.points_visited;
    work_.conflicting |= island.report.conflicting;
  }
}

}  // namespace tenon
