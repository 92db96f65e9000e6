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
  result_.multipliers.resize(kMaxPairContacts);
}

void CollPair::setEnabled(bool enabled) noexcept {
  if (enabled == enabled_) return;
  enabled_ = enabled;
  forget();
}

void CollPair::forget() noexcept {
  looked_ = false;
  due_ = 0;
  looked_tick_ = 0;
  closing_speed_ = 0.0;
  result_.query.contacts.clear();
  result_.F_Ao_W = Wrench{};
}

double CollPair::clearance(Tick now) const noexcept {
  if (!looked_) return -std::numeric_limits<double>::infinity();
  const double ticks = static_cast<double>(now - looked_tick_);
  return result_.query.smallest_gap - closing_speed_ * kTickSeconds * ticks;
}

void CollPair::query(const Pose& X_WA, const Pose& X_WB, double margin) noexcept {
  queryPair({shell_A_, field_B_, X_WA, X_WB, spec_->dilation, margin}, result_.query);
  std::fill_n(result_.multipliers.begin(), result_.query.contacts.size(), 0.0);
  result_.F_Ao_W = Wrench{};
  looked_ = true;
}

void CollPair::press(double stiffness, const Pose& X_WA) noexcept {
  result_.F_Ao_W = penaltyWrench(result_.query, X_WA.translation(), stiffness);
}

void CollPair::take(const IslandPairResult& result) noexcept {
  copyResult(result, result_);
  looked_ = true;
}

void CollPair::schedule(Tick now, double closing_speed, double reach) noexcept {
  looked_tick_ = now;
  closing_speed_ = closing_speed;
  const double slack = result_.query.smallest_gap - reach;
  if (closing_speed <= 0.0) {
    due_ = kNever;
  } else {
    // an hour is as good as never, and keeps the conversion in range
    constexpr double kManyTicks = 3.6e6;
    const double ticks = std::clamp(slack / (closing_speed * kTickSeconds), 0.0, kManyTicks);
    due_ = now + 1 + static_cast<Tick>(ticks);
  }
}

IslandPair CollPair::islandPair(const Pose& X_WA, const Pose& X_WB) const noexcept {
  IslandPair pair;
  pair.shell_A = shell_A_;
  pair.field_B = field_B_;
  pair.X_WA_static = X_WA;
  pair.X_WB_static = X_WB;
  pair.dilation = spec_->dilation;
  return pair;
}

void copyResult(const IslandPairResult& from, IslandPairResult& to) noexcept {
  const std::size_t size = from.query.contacts.size();
  to.query.contacts.resize(size);
  std::copy_n(from.query.contacts.begin(), size, to.query.contacts.begin());
  to.query.counts = from.query.counts;
  to.query.smallest_gap = from.query.smallest_gap;
  to.query.deepest = from.query.deepest;
  std::copy_n(from.multipliers.begin(), size, to.multipliers.begin());
  to.F_Ao_W = from.F_Ao_W;
}

}  // namespace tenon
