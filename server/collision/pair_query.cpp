#include "server/collision/pair_query.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "server/collision/contact_blocks.h"
#include "server/collision/contact_reducer.h"
#include "server/collision/query_kernels.h"
#include "server/collision/ridge_correction.h"
#include "server/collision/valley_correction.h"

namespace tenon::collision {
namespace {

/// For a lane without a usable gradient of B's field: B pushes along the inward normal of A's own surface.
void setNormal(const LaneFrame& frame, const Vector3f& inward_A, std::size_t lane, ContactLanes& lanes) {
  const Vector3 n_W = (frame.R_WA * inward_A.cast<double>()).normalized();
  lanes.n_x[lane] = n_W.x();
  lanes.n_y[lane] = n_W.y();
  lanes.n_z[lane] = n_W.z();
}

/// Sets position, normal and gap [m].
void setContact(const ContactLanes& lanes, std::size_t lane, double gap, Contact& contact) {
  contact.p_WP = Vector3(lanes.x[lane], lanes.y[lane], lanes.z[lane]);
  contact.n_W = Vector3(lanes.n_x[lane], lanes.n_y[lane], lanes.n_z[lane]);
  contact.gap = gap;
}

/// Calls `visit(lane)` for every set bit, lowest first.
template <typename Visit>
void forEachLane(std::uint32_t bits, Visit&& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

static_assert(NearPoints::kCapacity >= Candidates::kCapacity + kMaxPairContacts);

/// One traversal of a pointshell, level by level: culls clusters, leaves and points, samples the remaining
/// candidates and takes the near ones among them. What is listed is decided first; positions and normals are
/// computed of these alone.
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
        correct_valleys_(query.correct_valleys),
        stop_when_full_(query.stop_when_full),
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

  /// Whether it gave up (PairQuery::stop_when_full).
  [[nodiscard]] bool full() const { return full_; }

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

  /// Lists what was taken.
  void listContacts() {
    reducer_.keepSmallestGaps(near_);
    if (correct_valleys_) correctNearValleys();
    for (std::size_t first = 0; first < near_.count; first += structures::ShellBlock::kLanes) {
      ContactLanes lanes;
      kernels_.near_contacts(frame_, near_, first, lanes);
      const std::size_t count = std::min(near_.count - first, structures::ShellBlock::kLanes);
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t point = near_.point[first + i];
        if ((lanes.has_normal >> i & 1U) == 0) setNormal(frame_, shell_.points()[point].inward_M, i, lanes);
        Contact& contact = *result_.contacts.extend();
        setContact(lanes, i, near_.gap[first + i], contact);
        contact.area = areaOf(point);
        contact.point = point;
        contact.other = 0;
        contact.kind = ContactKind::kShellPoint;
      }
    }
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
    if (full_) {
      clusters_.clear();
      return;
    }
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

  /// Samples the field at the candidates, and takes the near ones.
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
    if (list_ && sums.near > 0) takeNear(points, sums.near);
    candidates_.count = 0;
  }

  void takeNear(const PointLanes& points, std::size_t count) {
    if (sum_penalty_) sumPenalties(points);
    if (!near_.fits(count)) reducer_.keepSmallestGaps(near_);
    const std::size_t first = near_.count;
    for (std::uint32_t from = 0; from < candidates_.count; from += structures::ShellBlock::kLanes)
      takeBlock(from);
    if (reduce_) reducer_.reduceLeaves(frame_, shell_, first, near_);
    full_ = stop_when_full_ && near_.count > kMaxPairContacts;
  }

  /// Takes the near ones of the sixteen candidates from number `first` on.
  void takeBlock(std::uint32_t first) {
    const SampleLanes& samples = samples_[first / structures::ShellBlock::kLanes];
    std::size_t n = near_.count;
    forEachLane(samples.near, [&](std::uint32_t i) {
      near_.gap[n] = samples.distance[i];
      near_.gradient_x[n] = samples.gradient_x[i];
      near_.gradient_y[n] = samples.gradient_y[i];
      near_.gradient_z[n] = samples.gradient_z[i];
      near_.x[n] = candidates_.x[first + i];
      near_.y[n] = candidates_.y[first + i];
      near_.z[n] = candidates_.z[first + i];
      near_.point[n] = candidates_.point[first + i];
      ++n;
    });
    near_.count = n;
  }

  /// Valley correction of what is listed.
  void correctNearValleys() {
    bool corrected = false;
    for (std::size_t i = 0; i < near_.count; ++i) {
      if (!mayBeInValley(frame_.field, near_.gap[i], near_.gradient(i).squaredNorm())) continue;
      structures::FieldSample sample{near_.gap[i], near_.gradient(i), true};
      if (!correctValley(frame_, kernels_, frame_.inB(Vector3(near_.x[i], near_.y[i], near_.z[i])), sample))
        continue;
      near_.set(i, sample);
      corrected = true;
    }
    if (!corrected) return;
    result_.smallest_gap = result_.unlisted_gap;
    for (std::size_t i = 0; i < near_.count; ++i)
      result_.smallest_gap = std::min(result_.smallest_gap, near_.gap[i]);
    result_.deepest = std::max(-result_.smallest_gap, 0.0);
  }

  /// Fills the last block up: kernels read whole blocks.
  void padCandidates() {
    for (std::size_t i = candidates_.count; i < candidates_.count + structures::ShellBlock::kLanes; ++i) {
      candidates_.x[i] = candidates_.y[i] = candidates_.z[i] = 0.0F;
      candidates_.point[i] = 0;
    }
  }

  [[nodiscard]] double areaOf(std::uint32_t point) const {
    return point < areas_.size() ? static_cast<double>(areas_[point]) : 0.0;
  }

  /// Sums the penalties of sampled candidates.
  void sumPenalties(const PointLanes& points) {
    constexpr std::size_t kLanes = structures::ShellBlock::kLanes;
    for (std::size_t first = 0; first < points.count; first += kLanes) {
      const SampleLanes& samples = samples_[first / kLanes];
      if (samples.near == 0) continue;
      const PointLanes block{points.x + first, points.y + first, points.z + first,
                             std::min(kLanes, points.count - first)};
      ContactLanes contacts;
      kernels_.contacts(frame_, block, &samples, &contacts);
      forEachLane(samples.near & ~contacts.has_normal, [&](std::uint32_t i) {
        setNormal(frame_, shell_.points()[candidates_.point[first + i]].inward_M, i, contacts);
      });
      PenaltyLanes penalty;
      kernels_.penalties(frame_, samples, contacts, &candidates_.point[first], areas_, penalty);
      Wrench sum = result_.penalty_Ao_W;
      for (std::size_t i = 0; i < kLanes; ++i) {
        sum.force += Vector3(penalty.f_x[i], penalty.f_y[i], penalty.f_z[i]);
        sum.torque += Vector3(penalty.t_x[i], penalty.t_y[i], penalty.t_z[i]);
      }
      result_.penalty_Ao_W = sum;
      result_.penalty_points += static_cast<std::uint32_t>(std::popcount(penalty.inside));
    }
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
  std::array<SampleLanes, Candidates::kCapacity / structures::ShellBlock::kLanes>
      samples_;  ///< of candidates
  NearPoints near_;
  bool correct_ridges_;
  bool correct_valleys_;
  bool stop_when_full_;
  bool full_ = false;  ///< with stop_when_full_: more are near than the list takes
  PairQueryResult& result_;
  ContactReducer reducer_;
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
  if (traversal.full()) {
    result.counts.contacts_dropped = 1;
    return;
  }
  result.levels_used = static_cast<std::uint32_t>(used);
  if (used > 0 && used < levels.size()) {
    result.skipped_gap_error = levels[used - 1].spacing * query.field_B->slope();
    traversal.setAreas(query.shell_A->areasOfLevel(used - 1));
    traversal.testPriorityPoints(query.priority_points);
  }
  traversal.listContacts();
  result.traversal_points = result.counts.points_visited;

  if (result.counts.contacts_dropped > 0)
    result.unlisted_gap = std::min(result.unlisted_gap, result.complete_to);
}

namespace {

/// Valley correction of a block of sampled points; false when there is none.
bool correctValleys(const LaneFrame& frame, const QueryKernels& kernels, const structures::ShellBlock& points,
                    SampleLanes& samples) {
  bool corrected = false;
  forEachLane(samples.exact, [&](std::uint32_t i) {
    const Vector3 gradient(samples.gradient_x[i], samples.gradient_y[i], samples.gradient_z[i]);
    if (!mayBeInValley(frame.field, samples.distance[i], gradient.squaredNorm())) return;
    structures::FieldSample sample{samples.distance[i], gradient, true};
    if (!correctValley(frame, kernels, frame.inB(Vector3(points.x[i], points.y[i], points.z[i])), sample))
      return;
    samples.distance[i] = sample.distance;
    samples.gradient_x[i] = sample.gradient.x();
    samples.gradient_y[i] = sample.gradient.y();
    samples.gradient_z[i] = sample.gradient.z();
    corrected = true;
  });
  return corrected;
}

double smallestOf(const SampleLanes& samples, std::uint32_t count) {
  return *std::min_element(samples.distance.begin(), samples.distance.begin() + count);
}

}  // namespace

ResampledPart resamplePart(const PairQuery& query, std::span<Contact> contacts) noexcept {
  const LaneFrame frame(*query.field_B, query.X_WA, query.X_WB, query.margin, query.shell_A->radius());
  const QueryKernels& kernels = chosenKernels();
  const std::span<const structures::ShellPoint> points = query.shell_A->points();
  ResampledPart part;
  part.smallest_gap = kFarGap;
  for (std::size_t first = 0; first < contacts.size(); first += structures::ShellBlock::kLanes) {
    const structures::ShellBlock block = blockOf(*query.shell_A, contacts, first);
    SampleLanes samples;
    SampleSums sums;
    ContactLanes contact_lanes;
    const PointLanes points_A{block.x.data(), block.y.data(), block.z.data(), block.count};
    kernels.samples(frame, points_A, &samples, sums);
    const bool corrected = query.correct_valleys && correctValleys(frame, kernels, block, samples);
    part.smallest_gap =
        std::min(part.smallest_gap, corrected ? smallestOf(samples, block.count) : sums.smallest_distance);
    part.points_colliding += sums.colliding;
    kernels.contacts(frame, points_A, &samples, &contact_lanes);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      if ((samples.exact >> i & 1U) == 0) {
        part.smallest_left_gap = std::min(part.smallest_left_gap, samples.distance[i]);
        continue;
      }
      const std::uint32_t point = contacts[first + i].point;
      if ((contact_lanes.has_normal >> i & 1U) == 0)
        setNormal(frame, points[point].inward_M, i, contact_lanes);
      Contact& contact = contacts[part.kept++];
      if (&contact != &contacts[first + i]) contact = contacts[first + i];
      setContact(contact_lanes, i, samples.distance[i], contact);
    }
  }
  return part;
}

void resampleContacts(const PairQuery& query, double displacement, PairQueryResult& result) noexcept {
  const ResampledPart part = resamplePart(query, {result.contacts.begin(), result.contacts.size()});
  // a bound below 0 is no overlap
  result.smallest_gap = std::min(std::max(result.unlisted_gap - displacement, 0.0), part.smallest_gap);
  result.deepest = std::max(-part.smallest_gap, 0.0);
  // unlisted_gap is for the poses of the traversal: a point that left may come nearer again when A moves back
  // there
  result.unlisted_gap = std::min(result.unlisted_gap, part.smallest_left_gap - displacement);
  if (!result.reduced) result.counts.points_colliding = part.points_colliding;
  result.contacts.resize(part.kept);
}

}  // namespace tenon::collision
