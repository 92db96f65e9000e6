#include "server/simulation/coll_pair.h"

#include <algorithm>

namespace tenon {

CollPair::CollPair(const Scene& scene, std::size_t pair) : spec_(&scene.pairs[pair]) {
  const ObjectSpec& a = scene.objects[spec_->a.value];
  const ObjectSpec& b = scene.objects[spec_->b.value];
  const bool apart = a.group == 0 || a.group != b.group;
  possible_ = apart && spec_->a != spec_->b && a.structures && b.structures && !a.structures->shell.empty() &&
              !b.structures->field.empty();
  if (possible_) {
    shell_A_ = &a.structures->shell;
    field_B_ = &b.structures->field;
  }
  enabled_ = spec_->enabled;
}

void CollPair::setEnabled(bool enabled) noexcept {
  if (enabled == enabled_) return;
  enabled_ = enabled;
  forget();
}

void CollPair::forget() noexcept {
  looked_ = false;
  due_ = 0;
  travelled_ = 0.0;
  gap_ = 0.0;
  deepest_ = 0.0;
  counts_ = QueryCounts{};
  if (room_ == nullptr) return;
  room_->query.contacts.clear();
  room_->walked = WalkedAt{};
  room_->F_Ao_W = Wrench{};
}

void CollPair::query(const Pose& X_WA, const Pose& X_WB, double margin) noexcept {
  queryPair({shell_A_, field_B_, X_WA, X_WB, spec_->dilation, margin}, room_->query);
  std::fill_n(room_->multipliers.begin(), room_->query.contacts.size(), 0.0);
  room_->F_Ao_W = Wrench{};
  room_->walked = WalkedAt{};
  room_->flanks = 0;
  room_->slides = false;
  note(room_->query);
}

void CollPair::press(double stiffness, const Pose& X_WA) noexcept {
  room_->F_Ao_W = penaltyWrench(room_->query, X_WA.translation(), stiffness);
}

void CollPair::take(const IslandPairResult& result, Tick now) noexcept {
  solved_ = now;
  copyResult(result, *room_);
  note(result.query);
}

void CollPair::note(const PairQueryResult& query) noexcept {
  looked_ = true;
  gap_ = query.smallest_gap;
  deepest_ = query.deepest;
  counts_ = query.counts;
}

bool CollPair::isSound(const IslandPairResult& room) const noexcept {
  const ContactList& contacts = room.query.contacts;
  return possible_ && room.flanks <= contacts.size() && room.walked.X_WA.isFinite() &&
         room.walked.X_WB.isFinite() &&
         std::all_of(contacts.begin(), contacts.end(),
                     [this](const Contact& c) { return c.point < shell_A_->points().size(); });
}

Tick CollPair::wholeTicks(double way, double closing_speed) noexcept {
  // an hour is as good as never, and keeps the conversion in range
  constexpr double kManyTicks = 3.6e6;
  return static_cast<Tick>(std::clamp(way / (closing_speed * kTickSeconds), 0.0, kManyTicks));
}

void CollPair::schedule(Tick now, double closing_speed, double reach, double travelled) noexcept {
  travelled_ = travelled;
  due_ = closing_speed <= 0.0 ? kNever : now + 1 + wholeTicks(gap_ - reach, closing_speed);
}

bool CollPair::putOff(Tick now, double closing_speed, double reach, double travelled) noexcept {
  const double left = gap_ - (travelled - travelled_) - reach;
  if (!looked_ || left <= 0.0) return false;
  if (closing_speed <= 0.0) {
    due_ = kNever;
    return true;
  }
  const Tick ticks = wholeTicks(left, closing_speed);
  if (ticks == 0) return false;
  due_ = now + ticks;
  return true;
}

IslandPair CollPair::islandPair(const Pose& X_WA, const Pose& X_WB, Tick now) const noexcept {
  IslandPair pair;
  pair.shell_A = shell_A_;
  pair.field_B = field_B_;
  pair.X_WA_static = X_WA;
  pair.X_WB_static = X_WB;
  pair.dilation = spec_->dilation;
  pair.friction = spec_->friction;
  pair.last = solvedBefore(now);
  return pair;
}

}  // namespace tenon
