#include "server/simulation/coll_pair.h"

#include <algorithm>

namespace tenon {
namespace {

/// [looks] A level that was left out comes back after so many with room for it, at first and at last: longer
/// than a hand's tremble, and not longer than a hand's patience.
constexpr std::uint32_t kFirstPatience = 50;
constexpr std::uint32_t kLongestPatience = 1600;

/// Room for a level is there when it is expected to take this share of the budget: expectations err.
constexpr double kRoomToGrow = 0.7;

}  // namespace

CollPair::CollPair(const Scene& scene, std::size_t pair) : spec_(&scene.pairs[pair]) {
  const ObjectSpec& a = scene.objects[spec_->a.value];
  const ObjectSpec& b = scene.objects[spec_->b.value];
  possible_ = spec_->a != spec_->b && a.structures && b.structures && !a.structures->shell.empty() &&
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
  left_out_ = 0.0;
  levels_ = levels_used_ = kAllLevels;
  calm_ = patience_ = 0;
  walk_points_ = 0;
  solved_ = 0;
  if (room_ == nullptr) return;
  room_->query.contacts.clear();
  room_->walked = WalkedAt{};
  room_->F_Ao_W = Wrench{};
}

void CollPair::query(const Pose& X_WA, const Pose& X_WB, double margin, std::uint32_t budget,
                     std::span<const std::uint32_t> first) noexcept {
  queryPair({shell_A_, field_B_, X_WA, X_WB, spec_->dilation, margin, levels_, budget, first}, room_->query);
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
  *room_ = result;
  note(result.query);
}

void CollPair::note(const PairQueryResult& query) noexcept {
  looked_ = true;
  gap_ = query.smallest_gap;
  deepest_ = query.deepest;
  counts_ = query.counts;
  left_out_ = query.left_out;
  levels_used_ = query.levels_used;
  walk_points_ = query.walk_points;
}

void CollPair::listTouching(TouchingPoints& points) const noexcept {
  points.clear();
  if (!lists()) return;
  const ContactList& contacts = room_->query.contacts;
  for (const bool holding : {true, false}) {
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const bool holds = room_->multipliers[i] > 0.0;
      if (holds != holding || (!holds && contacts[i].gap > kTouchGap)) continue;
      if (!points.push_back(contacts[i].point)) return;
    }
  }
}

void CollPair::adapt(const WorkLimits& limits, std::uint32_t budget) noexcept {
  const std::uint32_t all = allLevels();
  if (!limits.any()) {
    levels_ = kAllLevels;
    calm_ = patience_ = 0;
    return;
  }
  const bool critical = counts_.loadPercent() >= limits.critical_load && levels_used_ > 1;
  if (levels_used_ < std::min(levels_, all) || critical) {
    levels_ = critical ? levels_used_ - 1 : levels_used_;
    patience_ = std::clamp(2 * patience_, kFirstPatience, kLongestPatience);
    calm_ = 0;
    return;
  }
  const bool whole = levels_ >= all;
  calm_ = whole || nextLevelFits(limits, budget) ? calm_ + 1 : 0;
  if (whole && calm_ >= kLongestPatience) calm_ = patience_ = 0;
  if (whole || calm_ < patience_) return;
  ++levels_;
  calm_ = 0;
}

double CollPair::pointsOf(std::uint32_t levels) const noexcept {
  const ShellLevel& last = shell_A_->levels()[levels - 1];
  return static_cast<double>(last.first_point + last.point_count);
}

double CollPair::wholeLoad() const noexcept {
  const double load = counts_.loadPercent();
  return leftOut() == 0 || levels_used_ == 0 ? load : load * pointsOf(allLevels()) / pointsOf(levels_used_);
}

bool CollPair::nextLevelFits(const WorkLimits& limits, std::uint32_t budget) const noexcept {
  const double growth = pointsOf(levels_ + 1) / pointsOf(levels_);
  QueryCounts grown = counts_;
  grown.spheres_visited =
      static_cast<std::uint32_t>(std::min<double>(growth * counts_.spheres_visited, counts_.spheres_total));
  return growth * walk_points_ <= kRoomToGrow * budget && grown.loadPercent() < limits.critical_load;
}

bool CollPair::isSound(const IslandPairResult& room) const noexcept {
  const ContactList& contacts = room.query.contacts;
  return possible_ && room.flanks <= contacts.size() && room.walked.X_WA.isFinite() &&
         room.walked.X_WB.isFinite() &&
         std::all_of(room.multipliers.begin(),
                     room.multipliers.begin() + static_cast<std::ptrdiff_t>(contacts.size()),
                     [](double force) { return std::isfinite(force); }) &&
         std::all_of(contacts.begin(), contacts.end(), [this](const Contact& c) {
           return c.point < shell_A_->points().size() && c.p_WP.allFinite() && c.n_W.allFinite() &&
                  std::isfinite(c.gap);
         });
}

Tick CollPair::wholeTicks(double way, double closing_speed) noexcept {
  // an hour is as good as never, and keeps the conversion in range
  constexpr double kManyTicks = 3.6e6;
  return static_cast<Tick>(std::clamp(way / (closing_speed * kTickSeconds), 0.0, kManyTicks));
}

void CollPair::schedule(Tick now, double closing_speed, double reach, double travelled) noexcept {
  travelled_ = travelled;
  due_ = closing_speed <= 0.0 ? kNever : now + 1 + wholeTicks(gap_ - left_out_ - reach, closing_speed);
}

bool CollPair::putOff(Tick now, double closing_speed, double reach, double travelled) noexcept {
  const double left = gap_ - left_out_ - (travelled - travelled_) - reach;
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
  pair.friction = spec_->friction.value_or(Friction{});
  pair.last = solvedBefore(now);
  return pair;
}

}  // namespace tenon
