#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "server/collision/query_kernels.h"

namespace tenon {
namespace {

/// [m^2] The paper gives no unit for its stiffness; here K [N/m] is felt when 1 cm^2 of skin is inside.
constexpr double kReferenceArea = 1e-4;

/// Cosine of the angle up to which two normals push in the same direction.
constexpr double kSameDirection = 0.95;

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
  enum : std::uint8_t { kOpen, kGroup, kKept, kOut };
  std::array<std::uint8_t, Pointshell::kLeafPoints> state{};
  const auto nearest = [&](std::uint8_t among) {
    std::size_t best = points.size();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (state[i] == among && (best == points.size() || gap(points[i]) < gap(points[best]))) best = i;
    }
    return best;
  };
  for (std::size_t leader = nearest(kOpen); leader < points.size(); leader = nearest(kOpen)) {
    const Vector3 n = normal(points[leader]);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (state[i] == kOpen && sameDirection(n, normal(points[i]))) state[i] = kGroup;
    }
    state[leader] = kKept;
    for (std::size_t kept = 1; kept < limit; ++kept) {
      const std::size_t next = nearest(kGroup);
      if (next == points.size()) break;
      state[next] = kKept;
    }
    for (std::uint8_t& each : state) {
      if (each == kGroup) each = kOut;
    }
  }
  LeafSubset chosen;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (state[i] == kKept) chosen.push_back(points[i]);
  }
  return chosen;
}

bool smallerGap(const Contact& a, const Contact& b) {
  return a.gap != b.gap ? a.gap < b.gap : a.point < b.point;
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
      : frame_(*query.field_B, query.X_WA, query.X_WB, query.dilation, query.margin),
        kernels_(kernelsFor(*query.field_B)),
        shell_(*query.shell_A),
        sum_(query.sum),
        prune_(query.prune),
        can_thin_(query.thin),
        result_(result) {}

  void run(std::size_t levels) {
    if (!wholeReaches()) return;
    std::size_t block = 0;
    for (std::size_t k = 0; k < levels; ++k) {
      const ShellLevel& level = shell_.levels()[k];
      for (std::uint32_t c = 0; c < level.cluster_count; c += ShellBlock::kLanes) {
        const std::uint32_t reaching = reachingOf(shell_.clusterBlocks()[block++], false);
        forEachLane(reaching, [&](std::uint32_t i) { walk(level.first_cluster + c + i); });
      }
    }
  }

  void setAreaScale(double scale) { area_scale_ = scale; }

 private:
  bool wholeReaches() {
    ++result_.counts.spheres_visited;
    const double need = shell_.ballRadius() + frame_.sphere_slack + frame_.dilation;
    const double bound = frame_.field.lowerBound(frame_.inB(shell_.ballCentre())) - need;
    if (!prune_ || bound <= frame_.margin) return true;
    keepBound(bound);
    return false;
  }

  /// The balls that a contact may be in; the bounds of all others count as the gaps of their points.
  std::uint32_t reachingOf(const ShellBlock& balls, bool closer) {
    result_.counts.spheres_visited += balls.count;
    if (!prune_) return (1U << balls.count) - 1U;
    const BallLanes lanes = kernels_.balls(frame_, balls, closer);
    keepBound(lanes.smallest_bound);
    return lanes.reaching;
  }

  void keepBound(double bound) {
    result_.smallest_gap = std::min(result_.smallest_gap, bound);
    result_.others_gap = std::min(result_.others_gap, bound);
  }

  void walk(std::uint32_t cluster) {
    const std::uint32_t first = shell_.clusters()[cluster].first;
    const std::uint32_t reaching = reachingOf(shell_.leavesOfCluster(cluster), true);
    forEachLane(reaching, [&](std::uint32_t i) { test(first + i); });
  }

  void test(std::uint32_t number) {
    const ShellBlock& block = shell_.pointsOfLeaf(number);
    Lanes lanes;
    SampleLanes& samples = lanes.samples;
    kernels_.samples(frame_, block, samples);
    result_.counts.points_visited += block.count;
    result_.counts.points_colliding += samples.colliding;
    result_.smallest_gap = std::min(result_.smallest_gap, samples.smallest_distance - frame_.dilation);
    result_.deepest = std::max(result_.deepest, -samples.smallest_distance);
    result_.others_gap = std::min(result_.others_gap, samples.smallest_gap_apart);
    if (samples.near == 0) return;
    kernels_.contacts(frame_, block, samples, lanes.contacts);
    if (sum_) sumPush(shell_.leaves()[number].first, lanes);
    LeafSubset near;
    forEachLane(samples.near, [&near](std::uint32_t i) { near.push_back(i); });
    if (can_thin_) near = thinned(near, lanes);
    keep(shell_.leaves()[number].first, lanes, near);
  }

  void sumPush(std::uint32_t first, const Lanes& lanes) {
    forEachLane(lanes.samples.near, [&](std::uint32_t i) {
      Contact contact;
      const ShellPoint& point = shell_.points()[first + i];
      lanes.setContact(frame_, point, i, contact);
      if (contact.gap >= 0.0) return;
      contact.area = point.area * area_scale_;
      const Vector3 push = penaltyForce(contact, 1.0) * contact.n_W;
      result_.push_Ao_W += {push, (contact.p_WP - frame_.p_WA).cross(push)};
      ++result_.pushing;
    });
  }

  void keep(std::uint32_t first, const Lanes& lanes, const LeafSubset& near) {
    if (leaf_count_ < leaf_starts_.size()) {
      leaf_starts_[leaf_count_++] = static_cast<std::uint32_t>(result_.contacts.size());
    }
    for (const std::uint32_t i : near) {
      Contact contact;
      const ShellPoint& point = shell_.points()[first + i];
      lanes.setContact(frame_, point, i, contact);
      contact.area = point.area * area_scale_;
      contact.point = first + i;
      add(contact);
    }
  }

  /// What of a leaf's points may be listed; makes room for them if that is possible.
  LeafSubset thinned(const LeafSubset& near, const Lanes& lanes) {
    LeafSubset chosen = near;
    while (true) {
      if (per_leaf_ < near.size()) {
        chosen = nearestOfEachDirection(
            near, per_leaf_, [&](std::uint32_t i) { return lanes.samples.distance[i]; },
            [&](std::uint32_t i) { return lanes.gradient(i); });
      }
      const bool fits = result_.contacts.size() + chosen.size() <= ContactList::capacity();
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

  void add(const Contact& contact) {
    ContactList& contacts = result_.contacts;
    if (contacts.push_back(contact)) return;
    // full: a heap keeps the largest gap in front
    if (result_.counts.contacts_dropped++ == 0) std::make_heap(contacts.begin(), contacts.end(), smallerGap);
    if (!smallerGap(contact, contacts[0])) return;
    std::pop_heap(contacts.begin(), contacts.end(), smallerGap);
    contacts.back() = contact;
    std::push_heap(contacts.begin(), contacts.end(), smallerGap);
  }

  const LaneFrame frame_;
  const QueryKernels& kernels_;
  const Pointshell& shell_;
  bool sum_;
  bool prune_;
  bool can_thin_;
  double area_scale_ = 1.0;
  std::size_t per_leaf_ = Pointshell::kLeafPoints;           ///< and direction
  std::array<std::uint32_t, kMaxPairContacts> leaf_starts_;  ///< where the listed leaves begin
  std::size_t leaf_count_ = 0;
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
  if (query.shell_A->empty() || query.field_B->empty()) return;

  const auto levels = query.shell_A->levels();
  const std::size_t used = std::min<std::size_t>(query.levels, levels.size());
  result.counts.spheres_total = 1;
  for (std::size_t k = 0; k < used; ++k) {
    result.counts.spheres_total += levels[k].cluster_count + levels[k].leaf_count;
  }
  Walk walk(query, result);
  if (used > 0 && used < levels.size()) walk.setAreaScale(levels[used - 1].area_scale);
  walk.run(used);

  if (result.counts.contacts_dropped > 0) {
    result.listed_to = result.contacts[0].gap;
    result.others_gap = std::min(result.others_gap, result.listed_to);
    // a heap's order would depend on what was dropped; the order of points never does
    std::sort(result.contacts.begin(), result.contacts.end(),
              [](const Contact& a, const Contact& b) { return a.point < b.point; });
  }
}

void resampleContacts(const PairQuery& query, double moved, PairQueryResult& result) noexcept {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.dilation, query.margin);
  const QueryKernels& kernels = kernelsFor(*query.field_B);
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
    kernels.samples(frame, block, lanes.samples);
    kernels.contacts(frame, block, lanes.samples, lanes.contacts);
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
  result.counts.points_visited += static_cast<std::uint32_t>(contacts.size());
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
