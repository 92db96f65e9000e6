#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "server/collision/contact_blocks.h"
#include "server/collision/contact_reducer.h"
#include "server/collision/query_kernels.h"
#include "server/collision/ridge_correction.h"

namespace tenon::collision {
namespace {

/// Access to the samples and contacts of a block of sixteen points.
class ContactBlockView {
 public:
  ContactBlockView(const LaneFrame& frame, const SampleLanes& samples, ContactLanes& contacts)
      : frame_(frame), samples_(samples), contacts_(contacts) {}

  [[nodiscard]] std::uint32_t near() const { return samples_.near; }
  [[nodiscard]] double gap(std::size_t i) const { return samples_.distance[i]; }
  [[nodiscard]] Vector3 gradient(std::size_t i) const {
    return {samples_.gradient_x[i], samples_.gradient_y[i], samples_.gradient_z[i]};
  }
  /// For a lane without a usable gradient of B's field: B pushes along the inward normal of A's own surface.
  void setNormal(std::size_t i, const Vector3f& inward_A) {
    const Vector3 n_W = (frame_.R_WA * inward_A.cast<double>()).normalized();
    contacts_.n_x[i] = n_W.x();
    contacts_.n_y[i] = n_W.y();
    contacts_.n_z[i] = n_W.z();
  }
  /// Sets position, gap and normal.
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

/// Calls `visit(lane)` for every set bit, lowest first.
template <typename Visit>
void forEachLane(std::uint32_t bits, Visit&& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

static_assert(IncomingContacts::kCapacity >= Candidates::kCapacity);

/// One traversal of a pointshell, level by level: culls clusters, leaves and points, then samples the
/// remaining candidates and gathers the contacts among them.
class Traversal {
 public:
  Traversal(const PairQuery& query, PairQueryResult& result)
      : frame_(*query.field_B, query.X_WA, query.X_WB, query.margin, query.shell_A->radius()),
        kernels_(chosenKernels()),
        shell_(*query.shell_A),
        sum_penalty_(query.sum_penalty),
        list_(query.list),
        prune_(query.prune),
        reduce_(query.reduce),
        correct_ridges_(query.correct_ridges),
        result_(result),
        reducer_(result, -query.field_B->band(), query.margin) {}

  /// Uses at most `levels` levels and about `budget` points; returns the number of levels used.
  std::size_t run(std::size_t levels, std::size_t budget) {
    if (!shellInReach()) return levels;
    std::size_t block = 0;
    std::size_t before = 0;
    std::size_t k = 0;
    for (; k < levels; ++k) {
      const structures::ShellLevel& level = shell_.levels()[k];
      if (k > 0 && culled_.points + expectedPoints(k, culled_.points - before) > budget) break;
      before = culled_.points;
      const std::size_t first_block = block;
      block += (level.cluster_count + structures::ShellBlock::kLanes - 1) / structures::ShellBlock::kLanes;
      if (prune_ && !shell_.blockSpheres().empty()) {
        traverseBlocksInReach();
      } else {
        for (std::size_t b = first_block; b < block; ++b)
          traverseBlock(b, level.first_cluster + (b - first_block) * structures::ShellBlock::kLanes);
      }
      if (!clusters_.empty()) traverseClusters();
    }
    evaluateCandidates();
    result_.counts.spheres_visited += culled_.spheres;
    result_.counts.points_visited = culled_.points;
    lowerGapBound(std::min(frame_.gapOf(culled_.smallest_bound), kFarGap));
    return k;
  }

  /// Areas by point [m^2]; points beyond the end have area 0.
  void setAreas(std::span<const float> areas) { areas_ = areas; }

  /// Tests points of skipped levels; they are listed with area 0.
  void testPriorityPoints(std::span<const std::uint32_t> points) {
    reduce_ = false;
    for (const std::uint32_t point : points) {
      if (point < areas_.size() || point >= shell_.points().size()) continue;
      if (!candidates_.fitsBatch()) evaluateCandidates();
      append(point);
      ++result_.counts.points_visited;
    }
    evaluateCandidates();
  }

 private:
  /// Expected number of points of level k that will be tested, from the `last` tested of the level before.
  [[nodiscard]] std::size_t expectedPoints(std::size_t k, std::size_t last) const {
    const std::size_t seen = std::max<std::size_t>(last, structures::Pointshell::kLeafPoints);
    const std::size_t before = std::max(shell_.levels()[k - 1].point_count, 1U);
    return std::min<std::size_t>(seen * shell_.levels()[k].point_count / before,
                                 shell_.levels()[k].point_count);
  }

  /// Whether the bounding sphere of all points is within the margin.
  bool shellInReach() {
    ++result_.counts.spheres_visited;
    constexpr double kRounding = 1e-6;
    const Vector3 p_BC = frame_.inB(shell_.boundingCentre());
    const double bound = frame_.field.lowerBound(p_BC, shell_.boundingRadius() + kRounding);
    if (!prune_ || bound <= frame_.margin) return true;
    lowerGapBound(bound);
    return false;
  }

  /// Includes `bound` [m], a lower bound of the gaps of culled points, in the result.
  void lowerGapBound(double bound) {
    result_.smallest_gap = std::min(result_.smallest_gap, bound);
    result_.unlisted_gap = std::min(result_.unlisted_gap, bound);
  }

  /// The blocks of a shell of one level whose bounding spheres may hold a contact.
  void traverseBlocksInReach() {
    std::size_t first = 0;
    for (const structures::ShellBlock& spheres : shell_.blockSpheres()) {
      forEachLane(kernels_.clusters(frame_, spheres, culled_), [&](std::uint32_t i) {
        traverseBlock(first + i, (first + i) * structures::ShellBlock::kLanes);
      });
      first += structures::ShellBlock::kLanes;
    }
  }

  /// Block `block` of clusters, the first of which is `first_cluster`.
  void traverseBlock(std::size_t block, std::size_t first_cluster) {
    const structures::ShellBlock& balls = shell_.clusterBlocks()[block];
    const std::uint32_t in_reach =
        prune_ ? kernels_.clusters(frame_, balls, culled_) : (1U << balls.count) - 1U;
    forEachLane(in_reach,
                [&](std::uint32_t i) { traverseCluster(static_cast<std::uint32_t>(first_cluster) + i); });
  }

  /// Adds a cluster to the next batch.
  void traverseCluster(std::uint32_t cluster) {
    clusters_.push_back(cluster);
    if (clusters_.full()) traverseClusters();
  }

  void traverseClusters() {
    if (!candidates_.fitsBatch()) evaluateCandidates();
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

  void appendAll(const structures::ShellSphere& cluster) {
    culled_.spheres += cluster.count;
    for (const structures::ShellSphere& leaf : shell_.leaves().subspan(cluster.first, cluster.count)) {
      for (std::uint32_t i = 0; i < leaf.count; ++i) append(leaf.first + i);
      culled_.points += leaf.count;
    }
  }

  /// Samples the field at the candidates, then gathers the contacts among them, leaf by leaf.
  void evaluateCandidates() {
    padCandidates();
    const PointLanes points{candidates_.x.data(), candidates_.y.data(), candidates_.z.data(),
                            candidates_.count};
    SampleSums sums;
    kernels_.samples(frame_, points, samples_.data(), sums);
    if (correct_ridges_ && sums.colliding > 0) {
      const std::size_t blocks =
          (points.count + structures::ShellBlock::kLanes - 1) / structures::ShellBlock::kLanes;
      correctRidges(frame_, kernels_, points, {samples_.data(), blocks}, sums);
    }
    result_.counts.points_colliding += sums.colliding;
    result_.smallest_gap = std::min(result_.smallest_gap, sums.smallest_distance);
    result_.deepest = std::max(result_.deepest, -sums.smallest_distance);
    result_.unlisted_gap = std::min(result_.unlisted_gap, sums.smallest_far_gap);
    if (list_ && sums.near > 0) {
      kernels_.contacts(frame_, points, samples_.data(), contacts_.data());
      for (std::uint32_t first = 0; first < candidates_.count; first += structures::ShellBlock::kLanes)
        completeBlock(first);
      reduce_ ? gatherReduced() : gatherAll(sums.near);
    }
    candidates_.count = 0;
  }

  /// Fills the last block up: kernels read whole blocks.
  void padCandidates() {
    for (std::size_t i = candidates_.count; i < candidates_.count + structures::ShellBlock::kLanes; ++i) {
      candidates_.x[i] = candidates_.y[i] = candidates_.z[i] = 0.0F;
      candidates_.point[i] = 0;
    }
  }

  /// Sets missing normals of the block that starts at `first`, and sums its penalties.
  void completeBlock(std::uint32_t first) {
    ContactBlockView lanes = blockAt(first);
    const ContactLanes& contacts = contacts_[first / structures::ShellBlock::kLanes];
    forEachLane(lanes.near() & ~contacts.has_normal, [&](std::uint32_t i) {
      lanes.setNormal(i, shell_.points()[candidates_.point[first + i]].inward_M);
    });
    if (sum_penalty_ && lanes.near() != 0) sumPenalties(first);
  }

  [[nodiscard]] ContactBlockView blockAt(std::uint32_t candidate) {
    const std::size_t block = candidate / structures::ShellBlock::kLanes;
    return {frame_, samples_[block], contacts_[block]};
  }

  /// Calls `visit(lanes, i, candidate)` for the candidates that are contacts.
  template <typename Visit>
  void forEachNear(Visit&& visit) {
    for (std::uint32_t first = 0; first < candidates_.count; first += structures::ShellBlock::kLanes) {
      const ContactBlockView lanes = blockAt(first);
      forEachLane(lanes.near(), [&](std::uint32_t i) { visit(lanes, i, first + i); });
    }
  }

  void gatherAll(std::size_t near) {
    if (reducer_.fits(near)) {
      forEachNear([this](const ContactBlockView& lanes, std::uint32_t i, std::uint32_t candidate) {
        gather(lanes, i, candidates_.point[candidate]);
      });
      return;
    }
    forEachNear([this](const ContactBlockView& lanes, std::uint32_t i, std::uint32_t candidate) {
      incoming_.push_back(lanes.gap(i), candidates_.point[candidate], candidate);
    });
    gatherSmallestGaps();
  }

  /// Gathers those incoming contacts that stay.
  void gatherSmallestGaps() {
    const GapRank last = reducer_.evictFor(incoming_);
    for (std::size_t k = 0; k < incoming_.count; ++k) {
      if (!(last < GapRank{incoming_.gap[k], incoming_.point[k]})) gatherCandidate(incoming_.tag[k]);
    }
    incoming_.count = 0;
  }

  void gatherReduced() {
    std::array<std::uint32_t, LeafContacts::kCapacity> candidate;  // index of each contact of the leaf
    LeafContacts near;
    std::uint32_t leaf = 0;
    const auto close = [&] {
      if (near.count > 0) gatherLeaf(near, candidate);
      near.count = 0;
    };
    for (std::uint32_t first = 0; first < candidates_.count; first += structures::ShellBlock::kLanes) {
      const ContactBlockView lanes = blockAt(first);
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
    if (incoming_.count > 0) gatherSmallestGaps();
  }

  void gatherLeaf(const LeafContacts& near,
                  const std::array<std::uint32_t, LeafContacts::kCapacity>& candidate) {
    const std::uint32_t chosen = reducer_.reduceLeaf(near);
    const bool fits = incoming_.count == 0 && reducer_.fits(static_cast<std::size_t>(std::popcount(chosen)));
    forEachLane(chosen, [&](std::uint32_t k) {
      if (fits) {
        gatherCandidate(candidate[k]);
      } else {
        incoming_.push_back(near.gap[k], candidates_.point[candidate[k]], candidate[k]);
      }
    });
  }

  void gatherCandidate(std::uint32_t candidate) {
    gather(blockAt(candidate), candidate % structures::ShellBlock::kLanes, candidates_.point[candidate]);
  }

  void gather(const ContactBlockView& lanes, std::uint32_t i, std::uint32_t point) {
    Contact& contact = *result_.contacts.extend();
    lanes.setContact(i, contact);
    contact.point = point;
    contact.other = 0;
    contact.kind = ContactKind::kShellPoint;
    contact.area = areaOf(point);
  }

  [[nodiscard]] double areaOf(std::uint32_t point) const {
    return point < areas_.size() ? static_cast<double>(areas_[point]) : 0.0;
  }

  void sumPenalties(std::uint32_t first) {
    const SampleLanes& samples = samples_[first / structures::ShellBlock::kLanes];
    PenaltyLanes penalty;
    kernels_.penalties(frame_, samples, contacts_[first / structures::ShellBlock::kLanes],
                       &candidates_.point[first], areas_, penalty);
    Wrench sum = result_.penalty_Ao_W;
    for (std::size_t i = 0; i < structures::ShellBlock::kLanes; ++i) {
      sum.force += Vector3(penalty.f_x[i], penalty.f_y[i], penalty.f_z[i]);
      sum.torque += Vector3(penalty.t_x[i], penalty.t_y[i], penalty.t_z[i]);
    }
    result_.penalty_Ao_W = sum;
    result_.penalty_points += static_cast<std::uint32_t>(std::popcount(penalty.inside));
  }

  const LaneFrame frame_;
  const QueryKernels& kernels_;
  const structures::Pointshell& shell_;
  bool sum_penalty_;
  bool list_;
  bool prune_;
  bool reduce_;
  std::span<const float> areas_;  ///< of the levels in use
  CullResult culled_;
  FixedVector<std::uint32_t, Candidates::kBatchClusters> clusters_;  ///< of the next batch
  Candidates candidates_;
  // by block of candidates
  std::array<SampleLanes, Candidates::kCapacity / structures::ShellBlock::kLanes> samples_;
  std::array<ContactLanes, Candidates::kCapacity / structures::ShellBlock::kLanes> contacts_;
  bool correct_ridges_;
  PairQueryResult& result_;
  ContactReducer reducer_;
  IncomingContacts incoming_;  ///< used when the list cannot take all
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
  result.penalty_Ao_W = {};
  result.penalty_points = 0;
  result.deepest = 0.0;
  result.smallest_gap = kFarGap;
  result.unlisted_gap = kFarGap;
  result.reduced = false;
  result.complete_to = query.margin;
  result.levels_used = 0;
  result.traversal_points = 0;
  result.skipped_gap_error = 0.0;
  if (query.shell_A->empty() || query.field_B->empty()) return;

  const auto levels = query.shell_A->levels();
  const std::size_t allowed = std::min<std::size_t>(query.levels, levels.size());
  result.counts.spheres_total = query.shell_A->spheres();
  Traversal traversal(query, result);
  if (allowed > 0) traversal.setAreas(query.shell_A->areasOfLevel(allowed - 1));
  const std::size_t budget =
      std::max<std::size_t>(query.budget, query.priority_points.size()) - query.priority_points.size();
  const std::size_t used = traversal.run(allowed, budget);
  result.levels_used = static_cast<std::uint32_t>(used);
  if (used > 0 && used < levels.size()) {
    const std::span<const float> areas = query.shell_A->areasOfLevel(used - 1);
    for (Contact& contact : result.contacts) contact.area = areas[contact.point];
    result.skipped_gap_error = levels[used - 1].spacing * query.field_B->slope();
    traversal.setAreas(areas);
    traversal.testPriorityPoints(query.priority_points);
  }
  result.traversal_points = result.counts.points_visited;

  if (result.counts.contacts_dropped > 0)
    result.unlisted_gap = std::min(result.unlisted_gap, result.complete_to);
}

void resampleContacts(const PairQuery& query, double displacement, PairQueryResult& result) noexcept {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.margin, query.shell_A->radius());
  const QueryKernels& kernels = chosenKernels();
  const std::span<const structures::ShellPoint> points = query.shell_A->points();
  ContactList& contacts = result.contacts;
  result.smallest_gap = result.unlisted_gap - displacement;
  result.deepest = std::max(-result.smallest_gap, 0.0);
  SampleSums sums;
  std::size_t kept = 0;
  for (std::size_t first = 0; first < contacts.size(); first += structures::ShellBlock::kLanes) {
    const structures::ShellBlock block = blockOf(*query.shell_A, contacts, first);
    SampleLanes samples;
    ContactLanes contact_lanes;
    const PointLanes points_A{block.x.data(), block.y.data(), block.z.data(), block.count};
    kernels.samples(frame, points_A, &samples, sums);
    kernels.contacts(frame, points_A, &samples, &contact_lanes);
    ContactBlockView lanes(frame, samples, contact_lanes);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const auto [point, area] = std::pair(contacts[first + i].point, contacts[first + i].area);
      if ((samples.exact >> i & 1U) == 0) {
        // unlisted_gap is for the poses of the traversal: the point may come nearer again when A moves back
        // there
        result.unlisted_gap = std::min(result.unlisted_gap, samples.distance[i] - displacement);
        continue;
      }
      if ((contact_lanes.has_normal >> i & 1U) == 0) lanes.setNormal(i, points[point].inward_M);
      Contact& contact = contacts[kept++];
      lanes.setContact(i, contact);
      contact.point = point;
      contact.area = area;
    }
  }
  result.smallest_gap = std::min(result.smallest_gap, sums.smallest_distance);
  result.deepest = std::max(result.deepest, -sums.smallest_distance);
  if (!result.reduced) result.counts.points_colliding = sums.colliding;
  contacts.resize(kept);
}

}  // namespace tenon::collision
