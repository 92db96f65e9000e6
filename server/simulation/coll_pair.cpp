#include "server/simulation/coll_pair.h"

#include <algorithm>

namespace tenon::simulation {
namespace {

/// [queries] with headroom before a skipped level is restored, at first and at most: tremor of the
/// hand alone must not restore it, and it comes back within 1.6 s of queries in every tick.
constexpr std::uint32_t kMinRestoreDelay = 50;
constexpr std::uint32_t kMaxRestoreDelay = 1600;

/// [-] There is headroom for a level when the expected points are below this fraction of the budget.
constexpr double kRestoreHeadroom = 0.7;

}  // namespace

collision::PairFeatures featuresOf(const Scene& scene, const PairSpec& pair) {
  const auto& a = scene.objects[pair.a.value].structures;
  const auto& b = scene.objects[pair.b.value].structures;
  if (!a || !b) return {};
  return {&a->features, &b->features, &a->field, pair.most_dilation_a};
}

CollPair::CollPair(const Scene& scene, std::size_t pair) : spec_(&scene.pairs[pair]) {
  const ObjectSpec& a = scene.objects[spec_->a.value];
  const ObjectSpec& b = scene.objects[spec_->b.value];
  possible_ = spec_->a != spec_->b && a.structures && b.structures && !a.structures->shell.empty() &&
              !b.structures->field.empty();
  if (possible_) {
    shell_A_ = &a.structures->shell;
    field_B_ = &b.structures->field;
    features_ = featuresOf(scene, *spec_);
    slope_ = std::max(field_B_->slope(), features_.any() ? features_.field_A->slope() : 1.0);
  }
  enabled_ = spec_->enabled;
}

void CollPair::setEnabled(bool enabled) noexcept {
  if (enabled == enabled_) return;
  enabled_ = enabled;
  reset();
}

void CollPair::reset() noexcept {
  queried_ = false;
  due_ = 0;
  path_length_ = 0.0;
  gap_ = 0.0;
  depth_ = 0.0;
  counts_ = collision::QueryCounts{};
  skipped_spacing_ = 0.0;
  levels_ = levels_used_ = kAllLevels;
  queries_with_headroom_ = restore_delay_ = 0;
  traversal_points_ = 0;
  solved_ = 0;
  if (list_ == nullptr) return;
  list_->query.contacts.clear();
  list_->traversal = collision::TraversalState{};
  list_->F_Ao_W = Wrench{};
}

void CollPair::query(const Pose& X_WA, const Pose& X_WB, double margin, collision::FeatureScratch& scratch,
                     std::uint32_t budget, std::span<const std::uint32_t> priority_points) noexcept {
  collision::PairQuery query{shell_A_, field_B_, X_WA, X_WB, margin, levels_, budget, priority_points};
  query.correct_valleys = true;
  collision::queryPair(query, list_->query);
  collision::queryFeatures(query, features_, scratch, list_->query);
  std::fill_n(list_->multipliers.begin(), list_->query.contacts.size(), 0.0);
  list_->F_Ao_W = Wrench{};
  list_->traversal = collision::TraversalState{};
  list_->secondary_planes = 0;
  list_->slides = false;
  store(list_->query);
}

void CollPair::computePenaltyForce(double stiffness, const Pose& X_WA) noexcept {
  list_->F_Ao_W = collision::penaltyWrench(list_->query, X_WA.translation(), stiffness);
}

void CollPair::storeSolved(const collision::IslandPairResult& result, Tick now) noexcept {
  solved_ = now;
  *list_ = result;
  store(result.query);
}

void CollPair::store(const collision::PairQueryResult& query) noexcept {
  queried_ = true;
  gap_ = query.smallest_gap;
  depth_ = query.deepest;
  counts_ = query.counts;
  skipped_spacing_ = query.skipped_gap_error;
  levels_used_ = query.levels_used;
  traversal_points_ = query.traversal_points;
}

void CollPair::listTouching(TouchingPoints& points) const noexcept {
  points.clear();
  if (!hasContacts()) return;
  const collision::ContactList& contacts = list_->query.contacts;
  for (const bool with_force : {true, false}) {
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const bool has_force = list_->multipliers[i] > 0.0;
      if (contacts[i].kind != collision::ContactKind::kShellPoint) continue;
      if (has_force != with_force || (!has_force && contacts[i].gap > collision::kTouchGap)) continue;
      if (!points.push_back(contacts[i].point)) return;
    }
  }
}

void CollPair::adaptLevels(const WorkLimits& limits, std::uint32_t budget) noexcept {
  const std::uint32_t all = allLevels();
  if (!limits.any()) {
    levels_ = kAllLevels;
    queries_with_headroom_ = restore_delay_ = 0;
    return;
  }
  const bool critical = counts_.loadPercent() >= limits.critical_load && levels_used_ > 1;
  if (levels_used_ < std::min(levels_, all) || critical) {
    levels_ = critical ? levels_used_ - 1 : levels_used_;
    restore_delay_ = std::clamp(2 * restore_delay_, kMinRestoreDelay, kMaxRestoreDelay);
    queries_with_headroom_ = 0;
    return;
  }
  const bool all_levels = levels_ >= all;
  queries_with_headroom_ = all_levels || nextLevelFits(limits, budget) ? queries_with_headroom_ + 1 : 0;
  if (all_levels && queries_with_headroom_ >= kMaxRestoreDelay) queries_with_headroom_ = restore_delay_ = 0;
  if (all_levels || queries_with_headroom_ < restore_delay_) return;
  ++levels_;
  queries_with_headroom_ = 0;
}

double CollPair::pointsOf(std::uint32_t levels) const noexcept {
  const structures::ShellLevel& last = shell_A_->levels()[levels - 1];
  return static_cast<double>(last.first_point + last.point_count);
}

double CollPair::loadAtAllLevels() const noexcept {
  const double load = counts_.loadPercent();
  return skippedLevels() == 0 || levels_used_ == 0 ? load
                                                   : load * pointsOf(allLevels()) / pointsOf(levels_used_);
}

bool CollPair::nextLevelFits(const WorkLimits& limits, std::uint32_t budget) const noexcept {
  const double growth = pointsOf(levels_ + 1) / pointsOf(levels_);
  collision::QueryCounts grown = counts_;
  grown.spheres_visited =
      static_cast<std::uint32_t>(std::min<double>(growth * counts_.spheres_visited, counts_.spheres_total));
  return growth * traversal_points_ <= kRestoreHeadroom * budget &&
         grown.loadPercent() < limits.critical_load;
}

bool CollPair::isIndexValid(const collision::Contact& contact) const noexcept {
  switch (contact.kind) {
    case collision::ContactKind::kShellPoint:
      return contact.point < shell_A_->points().size();
    case collision::ContactKind::kFeaturePoint:
      return features_.any() && contact.point < features_.features_B->edges().size();
    case collision::ContactKind::kCrossing:
      return features_.any() && contact.point < features_.features_A->edges().size() &&
             contact.other < features_.features_B->edges().size() &&
             (collision::isEdge(*features_.features_A, contact.point) ||
              collision::isEdge(*features_.features_B, contact.other));
  }
  return false;
}

bool CollPair::isValid(const collision::IslandPairResult& list) const noexcept {
  const collision::ContactList& contacts = list.query.contacts;
  if (list.secondary_planes > contacts.size()) return false;
  const bool in_order = std::is_sorted(
      contacts.begin(), contacts.end() - list.secondary_planes,
      [](const collision::Contact& a, const collision::Contact& b) { return a.kind < b.kind; });
  return possible_ && in_order &&
         std::all_of(contacts.begin(), contacts.end(),
                     [this](const collision::Contact& c) { return isIndexValid(c); });
}

Tick CollPair::ticksToClose(double distance, double closing_speed) noexcept {
  // capped at an hour, which keeps the conversion to an integer in range
  constexpr double kMaxTicks = 3.6e6;
  return static_cast<Tick>(std::clamp(distance / (closing_speed * kTickSeconds), 0.0, kMaxTicks));
}

void CollPair::schedule(Tick now, double closing_speed, double margin, double path_length) noexcept {
  path_length_ = path_length;
  due_ = closing_speed <= 0.0
             ? kNever
             : now + 1 + ticksToClose(gap_ - skipped_spacing_ - margin, slope_ * closing_speed);
}

bool CollPair::postpone(Tick now, double closing_speed, double margin, double path_length,
                        double reach) noexcept {
  const double remaining = gap_ - skipped_spacing_ - slope_ * (path_length - path_length_) - margin;
  if (!queried_ || remaining <= 0.0) return false;
  if (closing_speed <= 0.0) {
    due_ = kNever;
    return true;
  }
  const Tick ticks = ticksToClose(remaining, slope_ * closing_speed);
  if (ticks == 0 && remaining <= reach) return false;
  due_ = now + std::max<Tick>(ticks, 1);
  return true;
}

collision::IslandPair CollPair::islandPair(const Pose& X_WA, const Pose& X_WB, Tick now) const noexcept {
  collision::IslandPair pair;
  pair.shell_A = shell_A_;
  pair.field_B = field_B_;
  pair.X_WA_static = X_WA;
  pair.X_WB_static = X_WB;
  pair.features = features_;
  pair.friction = spec_->friction.value_or(collision::Friction{});
  pair.last = solvedBefore(now);
  return pair;
}

collision::PairQuery CollPair::gapQuery(const Pose& X_WA, const Pose& X_WB, double margin) const noexcept {
  collision::PairQuery query;
  query.shell_A = shell_A_;
  query.field_B = field_B_;
  query.X_WA = X_WA;
  query.X_WB = X_WB;
  query.margin = margin;
  query.levels = levels_;
  query.list = false;
  return query;
}

double CollPair::findDepth(const Pose& X_WA, const Pose& X_WB,
                           collision::PairQueryResult& found) const noexcept {
  collision::queryPair(gapQuery(X_WA, X_WB, 0.0), found);
  return std::max(-found.smallest_gap, 0.0);
}

double CollPair::findGap(const Pose& X_WA, const Pose& X_WB, double limit, collision::PairQueryResult& found,
                         collision::FeatureScratch& scratch) const noexcept {
  const collision::PairQuery query = gapQuery(X_WA, X_WB, slope_ * limit);
  collision::queryPair(query, found);
  return std::min(found.smallest_gap - found.skipped_gap_error,
                  collision::featureGap(query, features_, scratch, found.counts)) /
         slope_;
}

}  // namespace tenon::simulation
