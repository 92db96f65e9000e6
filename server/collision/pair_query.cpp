#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <utility>

#include "server/collision/query_kernels.h"

namespace tenon {
namespace {

/// [m^2] The paper gives no unit for its stiffness; here K [N/m] is felt when 1 cm^2 of skin is inside.
constexpr double kReferenceArea = 1e-4;

/// Cosine of the angle up to which two normals push in the same direction.
constexpr double kSameDirection = 0.95;

/// A list that may be thinned is kept this short while there is anything to thin: every row of it costs in
/// every sub-step.
constexpr std::size_t kThinnedTo = 256;

/// Some of a leaf's points, by their number in it or in the list.
using LeafSubset = FixedVector<std::uint32_t, Pointshell::kLeafPoints>;

bool sameDirection(const Vector3& a, const Vector3& b) {
  const double dot = a.dot(b);
  return dot > 0.0 && dot * dot > kSameDirection * kSameDirection * a.squaredNorm() * b.squaredNorm();
}

/// Of the points of one leaf, those with the smallest gaps, at most `limit` of each direction; in order.
template <typename Gap, typename Normal>
LeafSubset nearestOfEachDirection(const LeafSubset& points, std::size_t limit, const Gap& gap,
                                  const Normal& normal) {
  // by gap
  std::array<double, Pointshell::kLeafPoints> gaps;
  std::array<std::uint8_t, Pointshell::kLeafPoints> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double own = gap(points[i]);
    std::size_t place = i;
    for (; place > 0 && own < gaps[place - 1]; --place) {
      gaps[place] = gaps[place - 1];
      order[place] = order[place - 1];
    }
    gaps[place] = own;
    order[place] = static_cast<std::uint8_t>(i);
  }
  // the nearest leads its direction, and each joins the first leader that it agrees with
  struct Direction {
    Vector3 n;
    std::size_t kept;
  };
  FixedVector<Direction, Pointshell::kLeafPoints> directions;
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3 n = normal(points[order[i]]);
    Direction* direction = std::find_if(directions.begin(), directions.end(),
                                        [&n](const Direction& each) { return sameDirection(each.n, n); });
    if (direction == directions.end()) {
      directions.push_back({n, 0});
      direction = &directions.back();
    }
    if (direction->kept++ < limit) kept |= 1U << order[i];
  }
  LeafSubset chosen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if ((kept >> i & 1U) != 0) chosen.push_back(points[i]);
  }
  return chosen;
}

/// How contacts are ranked: by gap, then by name.
struct GapRank {
  double gap;
  std::uint32_t point;

  bool operator<(const GapRank& other) const {
    return gap != other.gap ? gap < other.gap : point < other.point;
  }
};

/// The last contact that has a place when a full list and what found no room in it are one.
GapRank largestOfNearest(const ContactList& full, const ContactList& more) {
  // counted by gap in equal steps, then ranked within the step that the last place falls into
  constexpr std::size_t kSteps = 256;
  std::array<GapRank, 2 * kMaxPairContacts> all;
  std::size_t count = 0;
  for (const ContactList* from : {&full, &more}) {
    for (const Contact& contact : *from) all[count++] = {contact.gap, contact.point};
  }
  double low = all[0].gap;
  double high = low;
  for (std::size_t i = 0; i < count; ++i) {
    low = std::min(low, all[i].gap);
    high = std::max(high, all[i].gap);
  }
  const double scale = high > low ? static_cast<double>(kSteps - 1) / (high - low) : 0.0;
  const auto stepOf = [&](const GapRank& rank) { return static_cast<std::size_t>((rank.gap - low) * scale); };
  std::array<std::uint16_t, kSteps> histogram{};
  for (std::size_t i = 0; i < count; ++i) ++histogram[stepOf(all[i])];
  std::size_t before = 0;
  std::size_t step = 0;
  while (before + histogram[step] < kMaxPairContacts) before += histogram[step++];
  const auto end = std::remove_if(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count),
                                  [&](const GapRank& rank) { return stepOf(rank) != step; });
  const auto last = all.begin() + static_cast<std::ptrdiff_t>(kMaxPairContacts - before - 1);
  std::nth_element(all.begin(), last, end);
  return *last;
}

/// Sixteen points with all that a contact needs.
struct Lanes {
  SampleLanes samples;
  ContactLanes contacts;

  [[nodiscard]] Vector3 gradient(std::size_t i) const {
    return {samples.gradient_x[i], samples.gradient_y[i], samples.gradient_z[i]};
  }
  /// Sets place, gap and normal.
  void setContact(const LaneFrame& frame, const ShellPoint& point, std::size_t i, Contact& contact) const {
    contact.p_WP = Vector3(contacts.x[i], contacts.y[i], contacts.z[i]);
    contact.gap = samples.distance[i] - frame.dilation;
    // B pushes A out along its own normal or, where it has none, into A's own inside
    const bool sloping = (contacts.sloping >> i & 1U) != 0;
    contact.n_W = sloping ? Vector3(contacts.n_x[i], contacts.n_y[i], contacts.n_z[i])
                          : Vector3(frame.R_WA * point.inward_M.cast<double>()).normalized();
  }
};

/// Calls `visit(lane)` for every bit that is set, lowest first.
template <typename Visit>
void forEachLane(std::uint32_t bits, Visit&& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

/// One walk over a shell: what stays the same from sphere to sphere.
class Walk {
 public:
  Walk(const PairQuery& query, PairQueryResult& result)
      : frame_(*query.field_B, query.X_WA, query.X_WB, query.dilation, query.margin, query.shell_A->radius()),
        kernels_(chosenKernels()),
        shell_(*query.shell_A),
        sum_(query.sum),
        prune_(query.prune),
        can_thin_(query.thin),
        result_(result) {}

  /// Returns how many levels were used.
  std::size_t run(std::size_t levels, std::size_t budget) {
    if (!wholeReaches()) return levels;
    std::size_t block = 0;
    std::size_t before = 0;
    std::size_t k = 0;
    for (; k < levels; ++k) {
      const ShellLevel& level = shell_.levels()[k];
      if (k > 0 && culled_.points + expected(k, culled_.points - before) > budget) break;
      before = culled_.points;
      for (std::uint32_t c = 0; c < level.cluster_count; c += ShellBlock::kLanes) {
        const ShellBlock& balls = shell_.clusterBlocks()[block++];
        const std::uint32_t reaching =
            prune_ ? kernels_.clusters(frame_, balls, culled_) : (1U << balls.count) - 1U;
        forEachLane(reaching, [&](std::uint32_t i) { walk(level.first_cluster + c + i); });
      }
    }
    judgeCandidates();
    selectDeepest();
    result_.counts.spheres_visited += culled_.spheres;
    result_.counts.points_visited = culled_.points;
    keepBound(std::min(frame_.gapOf(culled_.smallest_bound), kNothingNear));
    return k;
  }

  /// What points stand for; those beyond the end for nothing.
  void setAreas(std::span<const float> areas) { areas_ = areas; }

  /// Tests points of levels that were left out; others stand for their skin.
  void testAlso(std::span<const std::uint32_t> points) {
    can_thin_ = false;
    for (const std::uint32_t point : points) {
      if (point < areas_.size() || point >= shell_.points().size()) continue;
      if (!candidates_.hasRoomForCluster()) judgeCandidates();
      const Vector3f& p_AP = shell_.points()[point].p_MP;
      const std::uint32_t n = candidates_.count++;
      candidates_.x[n] = p_AP.x();
      candidates_.y[n] = p_AP.y();
      candidates_.z[n] = p_AP.z();
      candidates_.point[n] = point;
      candidates_.leaf_end[candidates_.leaves++] = static_cast<std::uint16_t>(candidates_.count);
      ++result_.counts.points_visited;
    }
    judgeCandidates();
    selectDeepest();
  }

 private:
  /// Points of level k that will be tested, if it is like the level before, of which `last` were.
  [[nodiscard]] std::size_t expected(std::size_t k, std::size_t last) const {
    const std::size_t seen = std::max<std::size_t>(last, Pointshell::kLeafPoints);
    const std::size_t before = std::max(shell_.levels()[k - 1].point_count, 1U);
    return std::min<std::size_t>(seen * shell_.levels()[k].point_count / before,
                                 shell_.levels()[k].point_count);
  }

  bool wholeReaches() {
    ++result_.counts.spheres_visited;
    constexpr double kRounding = 1e-6;
    const double need = shell_.ballRadius() + frame_.dilation + kRounding;
    const double bound = frame_.field.lowerBound(frame_.inB(shell_.ballCentre())) - need;
    if (!prune_ || bound <= frame_.margin) return true;
    keepBound(bound);
    return false;
  }

  /// What was left out counts as the gap of its points.
  void keepBound(double bound) {
    result_.smallest_gap = std::min(result_.smallest_gap, bound);
    result_.others_gap = std::min(result_.others_gap, bound);
  }

  void walk(std::uint32_t cluster) {
    if (!candidates_.hasRoomForCluster()) judgeCandidates();
    if (prune_) {
      kernels_.candidates(frame_, shell_, cluster, candidates_, culled_);
    } else {
      appendAll(shell_.clusters()[cluster]);
    }
  }

  void appendAll(const ShellSphere& cluster) {
    culled_.spheres += cluster.count;
    for (std::uint32_t leaf = cluster.first; leaf < cluster.first + cluster.count; ++leaf) {
      const ShellBlock& block = shell_.pointsOfLeaf(leaf);
      for (std::uint32_t i = 0; i < block.count; ++i) {
        const std::uint32_t n = candidates_.count++;
        candidates_.x[n] = block.x[i];
        candidates_.y[n] = block.y[i];
        candidates_.z[n] = block.z[i];
        candidates_.point[n] = shell_.leaves()[leaf].first + i;
      }
      culled_.points += block.count;
      candidates_.leaf_end[candidates_.leaves++] = static_cast<std::uint16_t>(candidates_.count);
    }
  }

  /// What the field says of the candidates, then the contacts among them leaf after leaf.
  void judgeCandidates() {
    padCandidates();
    for (std::uint32_t first = 0; first < candidates_.count; first += ShellBlock::kLanes) {
      const PointLanes points{candidates_.x.data() + first, candidates_.y.data() + first,
                              candidates_.z.data() + first,
                              std::min<std::size_t>(candidates_.count - first, ShellBlock::kLanes)};
      Lanes& lanes = lanes_[first / ShellBlock::kLanes];
      SampleLanes& samples = lanes.samples;
      kernels_.samples(frame_, points, samples);
      result_.counts.points_colliding += samples.colliding;
      result_.smallest_gap = std::min(result_.smallest_gap, samples.smallest_distance - frame_.dilation);
      result_.deepest = std::max(result_.deepest, -samples.smallest_distance);
      result_.others_gap = std::min(result_.others_gap, samples.smallest_gap_apart);
      if (samples.near != 0) kernels_.contacts(frame_, points, samples, lanes.contacts);
    }
    std::uint32_t first = 0;
    for (std::uint32_t leaf = 0; leaf < candidates_.leaves; ++leaf) {
      const std::uint32_t end = candidates_.leaf_end[leaf];
      listLeaf(first, end);
      first = end;
    }
    candidates_.count = candidates_.leaves = 0;
  }

  /// Kernels read whole vectors.
  void padCandidates() {
    for (std::size_t i = candidates_.count; i < candidates_.count + ShellBlock::kLanes; ++i) {
      candidates_.x[i] = candidates_.y[i] = candidates_.z[i] = 0.0F;
    }
  }

  [[nodiscard]] const Lanes& lanesOf(std::uint32_t candidate) const {
    return lanes_[candidate / ShellBlock::kLanes];
  }

  void listLeaf(std::uint32_t first, std::uint32_t end) {
    LeafSubset near;
    for (std::uint32_t i = first; i < end; ++i) {
      if ((lanesOf(i).samples.near >> i % ShellBlock::kLanes & 1U) != 0) near.push_back(i);
    }
    if (near.empty()) return;
    if (can_thin_) {
      if (sum_) {
        for (const std::uint32_t i : near) sumPush(contactOf(i));
      }
      near = thinned(near);
      if (leaf_count_ < leaf_starts_.size()) {
        leaf_starts_[leaf_count_++] = static_cast<std::uint32_t>(result_.contacts.size());
      }
      for (const std::uint32_t i : near) list(contactOf(i));
    } else {
      for (const std::uint32_t i : near) {
        const Contact contact = contactOf(i);
        if (sum_) sumPush(contact);
        list(contact);
      }
    }
  }

  [[nodiscard]] Contact contactOf(std::uint32_t candidate) const {
    Contact contact;
    contact.point = candidates_.point[candidate];
    const ShellPoint& point = shell_.points()[contact.point];
    lanesOf(candidate).setContact(frame_, point, candidate % ShellBlock::kLanes, contact);
    contact.area = contact.point < areas_.size() ? areas_[contact.point] : 0.0;
    return contact;
  }

  void sumPush(const Contact& contact) {
    if (contact.gap >= 0.0) return;
    const Vector3 push = penaltyForce(contact, 1.0) * contact.n_W;
    result_.push_Ao_W += {push, (contact.p_WP - frame_.p_WA).cross(push)};
    ++result_.pushing;
  }

  /// What of a leaf's points may be listed; makes room for them if that is possible.
  LeafSubset thinned(const LeafSubset& near) {
    LeafSubset chosen = near;
    while (true) {
      if (per_leaf_ < near.size()) {
        chosen = nearestOfEachDirection(
            near, per_leaf_,
            [&](std::uint32_t i) { return lanesOf(i).samples.distance[i % ShellBlock::kLanes]; },
            [&](std::uint32_t i) { return lanesOf(i).gradient(i % ShellBlock::kLanes); });
      }
      const bool fits = result_.contacts.size() + chosen.size() <= kThinnedTo;
      if (fits || per_leaf_ == 1 || result_.counts.contacts_dropped > 0) break;
      per_leaf_ /= 2;
      thinList();
    }
    result_.thinned = result_.thinned || chosen.size() < near.size();
    return chosen;
  }

  void thinList() {
    ContactList& contacts = result_.contacts;
    const std::size_t size = contacts.size();
    std::size_t kept = 0;
    for (std::size_t leaf = 0; leaf < leaf_count_; ++leaf) {
      const std::uint32_t first = leaf_starts_[leaf];
      const std::size_t end = leaf + 1 < leaf_count_ ? leaf_starts_[leaf + 1] : size;
      LeafSubset all;
      for (std::uint32_t i = first; i < end; ++i) all.push_back(i);
      leaf_starts_[leaf] = static_cast<std::uint32_t>(kept);
      const LeafSubset chosen = nearestOfEachDirection(
          all, per_leaf_, [&](std::uint32_t i) { return contacts[i].gap; },
          [&](std::uint32_t i) -> const Vector3& { return contacts[i].n_W; });
      for (const std::uint32_t i : chosen) contacts[kept++] = contacts[i];
    }
    contacts.resize(kept);
    result_.thinned = result_.thinned || kept < size;
  }

  void list(const Contact& contact) {
    if (result_.contacts.push_back(contact)) return;
    if (!overflow_) overflow_.emplace();
    if (overflow_->full()) selectDeepest();
    if (contact.gap > largest_listed_) {
      ++result_.counts.contacts_dropped;
    } else {
      overflow_->push_back(contact);
    }
  }

  /// Of what is listed and what found no room, the smallest gaps stay, in the order of the shell.
  void selectDeepest() {
    if (!overflow_ || overflow_->empty()) return;
    ContactList& contacts = result_.contacts;
    const GapRank largest = largestOfNearest(contacts, *overflow_);
    std::size_t kept = 0;
    for (const ContactList* from : {&std::as_const(contacts), &std::as_const(*overflow_)}) {
      for (const Contact& contact : *from) {
        if (!(largest < GapRank{contact.gap, contact.point})) contacts[kept++] = contact;
      }
    }
    result_.counts.contacts_dropped += static_cast<std::uint32_t>(overflow_->size());
    overflow_->clear();
    largest_listed_ = largest.gap;
  }

  const LaneFrame frame_;
  const QueryKernels& kernels_;
  const Pointshell& shell_;
  bool sum_;
  bool prune_;
  bool can_thin_;
  std::span<const float> areas_;  ///< of the levels in use
  Culled culled_;
  Candidates candidates_;
  std::array<Lanes, Candidates::kMost / ShellBlock::kLanes> lanes_;  ///< of the candidates
  std::size_t per_leaf_ = Pointshell::kLeafPoints;                   ///< and direction
  std::array<std::uint32_t, kMaxPairContacts> leaf_starts_;          ///< where the listed leaves begin
  std::size_t leaf_count_ = 0;
  std::optional<ContactList> overflow_;                              ///< contacts that found no room
  double largest_listed_ = std::numeric_limits<double>::infinity();  ///< no larger gap is needed
  PairQueryResult& result_;
};

}  // namespace

double QueryCounts::loadPercent() const {
  const auto ratio = [](std::uint32_t part, std::uint32_t whole) {
    return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
  };
  return 100.0 *
         (0.5 * ratio(spheres_visited, spheres_total) + 0.5 * ratio(points_colliding, points_visited));
}

void queryPair(const PairQuery& query, PairQueryResult& result) noexcept {
  result.contacts.clear();
  result.counts = {};
  result.push_Ao_W = {};
  result.pushing = 0;
  result.deepest = 0.0;
  result.smallest_gap = kNothingNear;
  result.others_gap = kNothingNear;
  result.thinned = false;
  result.listed_to = query.margin;
  result.levels_used = 0;
  result.walk_points = 0;
  result.left_out = 0.0;
  if (query.shell_A->empty() || query.field_B->empty()) return;

  const auto levels = query.shell_A->levels();
  const std::size_t allowed = std::min<std::size_t>(query.levels, levels.size());
  result.counts.spheres_total = 1;
  for (const ShellLevel& level : levels) {
    result.counts.spheres_total += level.cluster_count + level.leaf_count;
  }
  Walk walk(query, result);
  if (allowed > 0) walk.setAreas(query.shell_A->areasOfLevel(allowed - 1));
  const std::size_t budget = std::max<std::size_t>(query.budget, query.first.size()) - query.first.size();
  const std::size_t used = walk.run(allowed, budget);
  result.levels_used = static_cast<std::uint32_t>(used);
  if (used > 0 && used < levels.size()) {
    const std::span<const float> areas = query.shell_A->areasOfLevel(used - 1);
    for (Contact& contact : result.contacts) contact.area = areas[contact.point];
    result.left_out = levels[used - 1].spacing;
    walk.setAreas(areas);
    walk.testAlso(query.first);
  }
  result.walk_points = result.counts.points_visited;

  if (result.counts.contacts_dropped > 0) {
    result.listed_to = -kNothingNear;
    for (const Contact& contact : result.contacts) result.listed_to = std::max(result.listed_to, contact.gap);
    result.others_gap = std::min(result.others_gap, result.listed_to);
  }
}

void resampleContacts(const PairQuery& query, double moved, PairQueryResult& result) noexcept {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.dilation, query.margin,
                        query.shell_A->radius());
  const QueryKernels& kernels = chosenKernels();
  const std::span<const ShellPoint> points = query.shell_A->points();
  ContactList& contacts = result.contacts;
  result.smallest_gap = result.others_gap - moved;
  result.deepest = std::max(-(result.smallest_gap + query.dilation), 0.0);
  std::uint32_t colliding = 0;
  std::size_t kept = 0;
  for (std::size_t first = 0; first < contacts.size(); first += ShellBlock::kLanes) {
    ShellBlock block;
    block.count = static_cast<std::uint32_t>(std::min(contacts.size() - first, ShellBlock::kLanes));
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const Vector3f& p_AP = points[contacts[first + i].point].p_MP;
      block.x[i] = p_AP.x();
      block.y[i] = p_AP.y();
      block.z[i] = p_AP.z();
    }
    Lanes lanes;
    const PointLanes places{block.x.data(), block.y.data(), block.z.data(), block.count};
    kernels.samples(frame, places, lanes.samples);
    kernels.contacts(frame, places, lanes.samples, lanes.contacts);
    const double smallest = lanes.samples.smallest_distance;
    result.smallest_gap = std::min(result.smallest_gap, smallest - frame.dilation);
    result.deepest = std::max(result.deepest, -smallest);
    colliding += lanes.samples.colliding;
    for (std::uint32_t i = 0; i < block.count; ++i) {
      Contact contact = contacts[first + i];
      lanes.setContact(frame, points[contact.point], i, contact);
      if ((lanes.samples.exact >> i & 1U) != 0) {
        contacts[kept++] = contact;
      } else {
        result.others_gap = std::min(result.others_gap, contact.gap);
      }
    }
  }
  if (!result.thinned) result.counts.points_colliding = colliding;
  contacts.resize(kept);
}

double penaltyForce(const Contact& contact, double stiffness) noexcept {
  return std::max(-contact.gap, 0.0) * stiffness * contact.area / kReferenceArea;
}

Wrench penaltyWrench(const PairQueryResult& result, const Vector3& p_WAo, double stiffness) noexcept {
  Wrench F_Ao_W;
  for (const Contact& contact : result.contacts) {
    if (contact.gap >= 0.0) continue;
    const Vector3 f = penaltyForce(contact, stiffness) * contact.n_W;
    F_Ao_W += {f, (contact.p_WP - p_WAo).cross(f)};
  }
  return F_Ao_W;
}

std::size_t reduceContacts(const ContactList& contacts, std::span<std::uint32_t> out) noexcept {
  const std::size_t wanted = std::min(out.size(), contacts.size());
  if (wanted == 0) return 0;

  // a turn of the normal by 1 rad counts as much as a step over the whole patch
  std::size_t chosen = 0;
  Vector3 low = contacts[0].p_WP;
  Vector3 high = low;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].gap < contacts[chosen].gap) chosen = i;
    low = low.cwiseMin(contacts[i].p_WP);
    high = high.cwiseMax(contacts[i].p_WP);
  }
  const double extent2 = std::max((high - low).squaredNorm(), 1e-12);

  // then always the one farthest from all that are chosen
  std::array<double, kMaxPairContacts> apart2;
  apart2.fill(std::numeric_limits<double>::infinity());
  std::size_t count = 0;
  while (true) {
    out[count++] = static_cast<std::uint32_t>(chosen);
    if (count == wanted) return count;
    const Contact& last = contacts[chosen];
    apart2[chosen] = -1.0;
    std::size_t next = chosen;
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      if (apart2[i] < 0.0) continue;
      const double d2 =
          (contacts[i].p_WP - last.p_WP).squaredNorm() / extent2 + (contacts[i].n_W - last.n_W).squaredNorm();
      apart2[i] = std::min(apart2[i], d2);
      if (apart2[next] < 0.0 || apart2[i] > apart2[next]) next = i;
    }
    chosen = next;
  }
}

}  // namespace tenon
