#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "server/collision/contact_sink.h"
#include "server/collision/query_kernels.h"

namespace tenon {
namespace {

/// Sixteen points with all that a contact needs.
struct Lanes {
  SampleLanes samples;
  ContactLanes contacts;

  [[nodiscard]] Vector3 gradient(std::size_t i) const {
    return {samples.gradient_x[i], samples.gradient_y[i], samples.gradient_z[i]};
  }
  [[nodiscard]] double gap(const LaneFrame& frame, std::size_t i) const {
    return samples.distance[i] - frame.dilation;
  }
  /// B pushes A out along its own normal or, where it has none, into A's own inside.
  void setNormal(std::size_t i, const Vector3& inward_W) {
    const Vector3 n_W = inward_W.normalized();
    contacts.n_x[i] = n_W.x();
    contacts.n_y[i] = n_W.y();
    contacts.n_z[i] = n_W.z();
  }
  /// Sets place, gap and normal.
  void setContact(const LaneFrame& frame, std::size_t i, Contact& contact) const {
    contact.p_WP = Vector3(contacts.x[i], contacts.y[i], contacts.z[i]);
    contact.gap = gap(frame, i);
    contact.n_W = Vector3(contacts.n_x[i], contacts.n_y[i], contacts.n_z[i]);
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
        result_(result),
        sink_(result, -query.field_B->band() - query.dilation, query.margin) {}

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
    sink_.selectDeepest();
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
    sink_.selectDeepest();
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
      if (samples.near == 0) continue;
      kernels_.contacts(frame_, points, samples, lanes.contacts);
      forEachLane(samples.near & ~lanes.contacts.sloping,
                  [&](std::uint32_t i) { lanes.setNormal(i, inward_W(candidates_.point[first + i])); });
      if (sum_) sumPushes(first, lanes);
    }
    if (can_thin_) {
      listThinned();
    } else {
      listAll();
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

  /// Calls `visit(i)` for the candidates from `first` to before `end` that are contacts.
  template <typename Visit>
  void forEachNear(std::uint32_t first, std::uint32_t end, Visit&& visit) {
    constexpr std::uint32_t kLanes = ShellBlock::kLanes;
    for (std::uint32_t block = first / kLanes * kLanes; block < end; block += kLanes) {
      std::uint32_t near = lanesOf(block).samples.near;
      if (block < first) near &= ~0U << (first - block);
      if (block + kLanes > end) near &= (1U << (end - block)) - 1U;
      forEachLane(near, [&](std::uint32_t i) { visit(block + i); });
    }
  }

  [[nodiscard]] double gapOf(std::uint32_t candidate) const {
    return lanesOf(candidate).gap(frame_, candidate % ShellBlock::kLanes);
  }

  void listAll() {
    std::size_t near = 0;
    for (std::uint32_t first = 0; first < candidates_.count; first += ShellBlock::kLanes) {
      near += static_cast<std::size_t>(std::popcount(lanesOf(first).samples.near));
    }
    if (sink_.overflows(near)) {
      forEachNear(0, candidates_.count, [this](std::uint32_t i) { sink_.announce(gapOf(i)); });
    }
    forEachNear(0, candidates_.count, [this](std::uint32_t i) {
      if (sink_.wants(gapOf(i))) sink_.list(contactOf(i));
    });
  }

  void listThinned() {
    std::uint32_t first = 0;
    for (std::uint32_t leaf = 0; leaf < candidates_.leaves; ++leaf) {
      const std::uint32_t end = candidates_.leaf_end[leaf];
      LeafContacts near;
      std::array<std::uint32_t, LeafContacts::kMost> number;
      forEachNear(first, end, [&](std::uint32_t i) {
        number[near.count] = i;
        near.gap[near.count] = lanesOf(i).samples.distance[i % ShellBlock::kLanes];
        near.direction[near.count++] = lanesOf(i).gradient(i % ShellBlock::kLanes);
      });
      first = end;
      if (near.count == 0) continue;
      const std::uint32_t chosen = sink_.thinned(near);
      if (sink_.overflows(near.count)) {
        forEachLane(chosen, [&](std::uint32_t k) { sink_.announce(gapOf(number[k])); });
      }
      forEachLane(chosen, [&](std::uint32_t k) {
        const Contact contact = contactOf(number[k]);
        if (sink_.wants(contact.gap)) sink_.list(contact);
      });
    }
  }

  [[nodiscard]] Contact contactOf(std::uint32_t candidate) const {
    Contact contact;
    contact.point = candidates_.point[candidate];
    lanesOf(candidate).setContact(frame_, candidate % ShellBlock::kLanes, contact);
    contact.area = areaOf(contact.point);
    return contact;
  }

  [[nodiscard]] double areaOf(std::uint32_t point) const {
    return point < areas_.size() ? static_cast<double>(areas_[point]) : 0.0;
  }

  void sumPushes(std::uint32_t first, const Lanes& lanes) {
    alignas(64) std::array<float, ShellBlock::kLanes> area{};
    forEachLane(lanes.samples.near, [&](std::uint32_t i) {
      const std::uint32_t point = candidates_.point[first + i];
      if (point < areas_.size()) area[i] = areas_[point];
    });
    PushLanes push;
    const std::size_t count = std::min<std::size_t>(candidates_.count - first, ShellBlock::kLanes);
    kernels_.pushes(frame_, lanes.samples, lanes.contacts, {area.data(), count}, push);
    Wrench sum = result_.push_Ao_W;
    forEachLane(push.pushing, [&](std::uint32_t i) {
      sum.force += Vector3(push.f_x[i], push.f_y[i], push.f_z[i]);
      sum.torque += Vector3(push.t_x[i], push.t_y[i], push.t_z[i]);
    });
    result_.push_Ao_W = sum;
    result_.pushing += static_cast<std::uint32_t>(std::popcount(push.pushing));
  }

  [[nodiscard]] Vector3 inward_W(std::uint32_t point) const {
    return frame_.R_WA * shell_.points()[point].inward_M.cast<double>();
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
  PairQueryResult& result_;
  ContactSink sink_;
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
      if ((lanes.contacts.sloping >> i & 1U) == 0) {
        lanes.setNormal(i, frame.R_WA * points[contact.point].inward_M.cast<double>());
      }
      lanes.setContact(frame, i, contact);
      if ((lanes.samples.exact >> i & 1U) != 0) {
        contacts[kept++] = contact;
      } else {
        // as seen from where the list was made: from here back there it may come nearer again
        result.others_gap = std::min(result.others_gap, contact.gap - moved);
      }
    }
  }
  if (!result.thinned) result.counts.points_colliding = colliding;
  contacts.resize(kept);
}

}  // namespace tenon
