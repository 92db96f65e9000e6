#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "server/collision/contact_blocks.h"
#include "server/collision/contact_sink.h"
#include "server/collision/query_kernels.h"
#include "server/collision/straightening.h"

namespace tenon {
namespace {

/// Sixteen points with all that a contact needs.
class Lanes {
 public:
  Lanes(const LaneFrame& frame, const SampleLanes& samples, ContactLanes& contacts)
      : frame_(frame), samples_(samples), contacts_(contacts) {}

  [[nodiscard]] std::uint32_t near() const { return samples_.near; }
  [[nodiscard]] double gap(std::size_t i) const { return samples_.distance[i] - frame_.dilation; }
  [[nodiscard]] Vector3 gradient(std::size_t i) const {
    return {samples_.gradient_x[i], samples_.gradient_y[i], samples_.gradient_z[i]};
  }
  /// B pushes A out along its own normal or, where it has none, into A's own inside.
  void setNormal(std::size_t i, const Vector3f& inward_A) {
    const Vector3 n_W = (frame_.R_WA * inward_A.cast<double>()).normalized();
    contacts_.n_x[i] = n_W.x();
    contacts_.n_y[i] = n_W.y();
    contacts_.n_z[i] = n_W.z();
  }
  /// Sets place, gap and normal.
  void setContact(std::size_t i, Contact& contact) const {
    contact.p_WP = Vector3(contacts_.x[i], contacts_.y[i], contacts_.z[i]);
    contact.gap = gap(i);
    contact.n_W = Vector3(contacts_.n_x[i], contacts_.n_y[i], contacts_.n_z[i]);
  }

 private:
  const LaneFrame& frame_;
  const SampleLanes& samples_;
  ContactLanes& contacts_;
};

/// Calls `visit(lane)` for every bit that is set, lowest first.
template <typename Visit>
void forEachLane(std::uint32_t bits, Visit&& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

static_assert(IncomingContacts::kMost >= Candidates::kMost);

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
        straighten_(query.straighten),
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
      if (!clusters_.empty()) walkClusters();
    }
    judgeCandidates();
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
      if (!candidates_.hasRoom()) judgeCandidates();
      append(point);
      ++result_.counts.points_visited;
    }
    judgeCandidates();
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
    const Vector3 p_BC = frame_.inB(shell_.ballCentre());
    const double bound = frame_.field.lowerBound(p_BC, shell_.ballRadius() + kRounding) - frame_.dilation;
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
    clusters_.push_back(cluster);
    if (clusters_.full()) walkClusters();
  }

  void walkClusters() {
    if (!candidates_.hasRoom()) judgeCandidates();
    if (prune_) {
      kernels_.candidates(frame_, shell_, {clusters_.begin(), clusters_.end()}, candidates_, culled_);
    } else {
      for (const std::uint32_t cluster : clusters_) appendAll(shell_.clusters()[cluster]);
    }
    clusters_.clear();
  }

  void append(std::uint32_t point) {
    const Vector3f& p_AP = shell_.points()[point].p_MP;
    const std::uint32_t n = candidates_.count++;
    candidates_.x[n] = p_AP.x();
    candidates_.y[n] = p_AP.y();
    candidates_.z[n] = p_AP.z();
    candidates_.point[n] = point;
  }

  void appendAll(const ShellSphere& cluster) {
    culled_.spheres += cluster.count;
    for (const ShellSphere& leaf : shell_.leaves().subspan(cluster.first, cluster.count)) {
      for (std::uint32_t i = 0; i < leaf.count; ++i) append(leaf.first + i);
      culled_.points += leaf.count;
    }
  }

  /// What the field says of the candidates, then the contacts among them leaf after leaf.
  void judgeCandidates() {
    padCandidates();
    const PointLanes points{candidates_.x.data(), candidates_.y.data(), candidates_.z.data(),
                            candidates_.count};
    SampleSums sums;
    kernels_.samples(frame_, points, samples_.data(), sums);
    if (straighten_ && sums.colliding > 0) {
      const std::size_t blocks = (points.count + ShellBlock::kLanes - 1) / ShellBlock::kLanes;
      straighten(frame_, kernels_, points, {samples_.data(), blocks}, sums);
    }
    result_.counts.points_colliding += sums.colliding;
    result_.smallest_gap = std::min(result_.smallest_gap, sums.smallest_distance - frame_.dilation);
    result_.deepest = std::max(result_.deepest, -sums.smallest_distance);
    result_.others_gap = std::min(result_.others_gap, sums.smallest_gap_apart);
    if (sums.near > 0) {
      kernels_.contacts(frame_, points, samples_.data(), contacts_.data());
      for (std::uint32_t first = 0; first < candidates_.count; first += ShellBlock::kLanes) finish(first);
      can_thin_ ? listThinned() : listAll(sums.near);
    }
    candidates_.count = 0;
  }

  /// Kernels read whole blocks.
  void padCandidates() {
    for (std::size_t i = candidates_.count; i < candidates_.count + ShellBlock::kLanes; ++i) {
      candidates_.x[i] = candidates_.y[i] = candidates_.z[i] = 0.0F;
      candidates_.point[i] = 0;
    }
  }

  /// Normals of the block from `first` where the field has none, and what it pushes.
  void finish(std::uint32_t first) {
    Lanes lanes = lanesOf(first);
    const ContactLanes& contacts = contacts_[first / ShellBlock::kLanes];
    forEachLane(lanes.near() & ~contacts.sloping, [&](std::uint32_t i) {
      lanes.setNormal(i, shell_.points()[candidates_.point[first + i]].inward_M);
    });
    if (sum_ && lanes.near() != 0) sumPushes(first);
  }

  [[nodiscard]] Lanes lanesOf(std::uint32_t candidate) {
    const std::size_t block = candidate / ShellBlock::kLanes;
    return {frame_, samples_[block], contacts_[block]};
  }

  /// Calls `visit(lanes, i, candidate)` for the candidates that are contacts.
  template <typename Visit>
  void forEachNear(Visit&& visit) {
    for (std::uint32_t first = 0; first < candidates_.count; first += ShellBlock::kLanes) {
      const Lanes lanes = lanesOf(first);
      forEachLane(lanes.near(), [&](std::uint32_t i) { visit(lanes, i, first + i); });
    }
  }

  void listAll(std::size_t near) {
    if (sink_.hasRoom(near)) {
      forEachNear([this](const Lanes& lanes, std::uint32_t i, std::uint32_t candidate) {
        list(lanes, i, candidates_.point[candidate]);
      });
      return;
    }
    forEachNear([this](const Lanes& lanes, std::uint32_t i, std::uint32_t candidate) {
      coming_.push_back(lanes.gap(i), candidates_.point[candidate], candidate);
    });
    listDeepest();
  }

  /// Of those that come, what has room.
  void listDeepest() {
    const GapRank last = sink_.makeRoom(coming_);
    for (std::size_t k = 0; k < coming_.count; ++k) {
      if (!(last < GapRank{coming_.gap[k], coming_.point[k]})) listCandidate(coming_.number[k]);
    }
    coming_.count = 0;
  }

  void listThinned() {
    std::array<std::uint32_t, LeafContacts::kMost> candidate;  // of the leaf's contacts
    LeafContacts near;
    std::uint32_t leaf = 0;
    const auto close = [&] {
      if (near.count > 0) listLeaf(near, candidate);
      near.count = 0;
    };
    for (std::uint32_t first = 0; first < candidates_.count; first += ShellBlock::kLanes) {
      const Lanes lanes = lanesOf(first);
      forEachLane(lanes.near(), [&](std::uint32_t i) {
        const std::uint32_t own = shell_.leafOf(candidates_.point[first + i]);
        if (own != leaf) close();
        leaf = own;
        candidate[near.count] = first + i;
        near.gap[near.count] = lanes.gap(i);
        near.direction[near.count++] = lanes.gradient(i);
      });
    }
    close();
    if (coming_.count > 0) listDeepest();
  }

  void listLeaf(const LeafContacts& near, const std::array<std::uint32_t, LeafContacts::kMost>& candidate) {
    const std::uint32_t chosen = sink_.thinned(near);
    const bool has_room =
        coming_.count == 0 && sink_.hasRoom(static_cast<std::size_t>(std::popcount(chosen)));
    forEachLane(chosen, [&](std::uint32_t k) {
      if (has_room) {
        listCandidate(candidate[k]);
      } else {
        coming_.push_back(near.gap[k], candidates_.point[candidate[k]], candidate[k]);
      }
    });
  }

  void listCandidate(std::uint32_t candidate) {
    list(lanesOf(candidate), candidate % ShellBlock::kLanes, candidates_.point[candidate]);
  }

  void list(const Lanes& lanes, std::uint32_t i, std::uint32_t point) {
    Contact& contact = *result_.contacts.extend();
    lanes.setContact(i, contact);
    contact.point = point;
    contact.area = areaOf(point);
  }

  [[nodiscard]] double areaOf(std::uint32_t point) const {
    return point < areas_.size() ? static_cast<double>(areas_[point]) : 0.0;
  }

  void sumPushes(std::uint32_t first) {
    const SampleLanes& samples = samples_[first / ShellBlock::kLanes];
    PushLanes push;
    kernels_.pushes(frame_, samples, contacts_[first / ShellBlock::kLanes], &candidates_.point[first], areas_,
                    push);
    Wrench sum = result_.push_Ao_W;
    for (std::size_t i = 0; i < ShellBlock::kLanes; ++i) {
      sum.force += Vector3(push.f_x[i], push.f_y[i], push.f_z[i]);
      sum.torque += Vector3(push.t_x[i], push.t_y[i], push.t_z[i]);
    }
    result_.push_Ao_W = sum;
    result_.pushing += static_cast<std::uint32_t>(std::popcount(push.pushing));
  }

  const LaneFrame frame_;
  const QueryKernels& kernels_;
  const Pointshell& shell_;
  bool sum_;
  bool prune_;
  bool can_thin_;
  std::span<const float> areas_;  ///< of the levels in use
  Culled culled_;
  FixedVector<std::uint32_t, Candidates::kClusters> clusters_;  ///< to be walked
  Candidates candidates_;
  // of the candidates
  std::array<SampleLanes, Candidates::kMost / ShellBlock::kLanes> samples_;
  std::array<ContactLanes, Candidates::kMost / ShellBlock::kLanes> contacts_;
  bool straighten_;
  PairQueryResult& result_;
  ContactSink sink_;
  IncomingContacts coming_;  ///< when there is no room for all
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
  result.counts.spheres_total = query.shell_A->spheres();
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

  if (result.counts.contacts_dropped > 0) result.others_gap = std::min(result.others_gap, result.listed_to);
}

void resampleContacts(const PairQuery& query, double moved, PairQueryResult& result) noexcept {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.dilation, query.margin,
                        query.shell_A->radius());
  const QueryKernels& kernels = chosenKernels();
  const std::span<const ShellPoint> points = query.shell_A->points();
  ContactList& contacts = result.contacts;
  result.smallest_gap = result.others_gap - moved;
  result.deepest = std::max(-(result.smallest_gap + query.dilation), 0.0);
  SampleSums sums;
  std::size_t kept = 0;
  for (std::size_t first = 0; first < contacts.size(); first += ShellBlock::kLanes) {
    const ShellBlock block = blockOf(*query.shell_A, contacts, first);
    SampleLanes samples;
    ContactLanes sides;
    const PointLanes places{block.x.data(), block.y.data(), block.z.data(), block.count};
    kernels.samples(frame, places, &samples, sums);
    kernels.contacts(frame, places, &samples, &sides);
    Lanes lanes(frame, samples, sides);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const auto [point, area] = std::pair(contacts[first + i].point, contacts[first + i].area);
      if ((samples.exact >> i & 1U) == 0) {
        // as seen from where the list was made: from here back there it may come nearer again
        result.others_gap = std::min(result.others_gap, samples.distance[i] - frame.dilation - moved);
        continue;
      }
      if ((sides.sloping >> i & 1U) == 0) lanes.setNormal(i, points[point].inward_M);
      Contact& contact = contacts[kept++];
      lanes.setContact(i, contact);
      contact.point = point;
      contact.area = area;
    }
  }
  result.smallest_gap = std::min(result.smallest_gap, sums.smallest_distance - frame.dilation);
  result.deepest = std::max(result.deepest, -sums.smallest_distance);
  if (!result.thinned) result.counts.points_colliding = sums.colliding;
  contacts.resize(kept);
}

}  // namespace tenon
