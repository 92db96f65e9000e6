#include "server/collision/pair_query.h"

#include <algorithm>
#include <limits>

namespace tenon {
namespace {

/// [m] Sphere centres and radii are stored as floats: what rounding may take from a ball is given back.
constexpr double kSphereSlack = 1e-6;

/// Below this the interpolant's gradient says nothing: the point is near a medial axis (a thin sheet's
/// middle).
constexpr double kLeastGradient = 0.3;

/// [m^2] The paper gives no unit for its stiffness; here K [N/m] is felt when 1 cm^2 of skin is inside.
constexpr double kReferenceArea = 1e-4;

/// [m] The gap of a pair that has nothing to test: far, yet a number that can be divided.
constexpr double kNothingNear = 1e6;

/// Half the diagonal of a voxel, rounded up: no interpolated distance is further from the truth [voxels].
constexpr double kHalfDiagonal = 0.8661;

/// Cosine of the angle up to which two normals push in the same direction.
constexpr double kSameDirection = 0.95;

/// The points of one leaf, as lanes: seen in M of the field, and what the field says there.
struct Lanes {
  std::array<double, Pointshell::kLeafPoints> x, y, z;
  std::array<FieldSample, Pointshell::kLeafPoints> samples;
};

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

/// Both bodies of a query, as its points see them.
class Frames {
 public:
  explicit Frames(const PairQuery& query)
      : field_(*query.field_B),
        dilation_(query.dilation),
        R_WA_(query.X_WA.matrix()),
        R_WB_(query.X_WB.matrix()),
        p_WA_(query.X_WA.translation()) {
    const Pose X_BA = query.X_WB.inverse() * query.X_WA;
    R_BA_ = X_BA.matrix();
    p_BA_B_ = X_BA.translation();
  }

  [[nodiscard]] Vector3 inB(const Vector3& p_AP) const { return p_BA_B_ + R_BA_ * p_AP; }

  /// Sets place, gap and normal.
  void setContact(const ShellPoint& point, const FieldSample& sample, Contact& contact) const {
    contact.p_WP = p_WA_ + R_WA_ * point.p_MP.cast<double>();
    contact.gap = sample.distance - dilation_;
    // B pushes A out along its own normal or, where it has none, into A's own inside
    const double slope = sample.gradient.norm();
    contact.n_W = slope >= kLeastGradient ? Vector3(R_WB_ * (sample.gradient / slope))
                                          : Vector3(R_WA_ * point.inward_M.cast<double>()).normalized();
  }

 protected:
  const DistanceField& field_;
  double dilation_;

 private:
  Matrix3 R_WA_, R_WB_, R_BA_;
  Vector3 p_WA_, p_BA_B_;
};

/// One walk over a shell: what stays the same from sphere to sphere.
class Walk : private Frames {
 public:
  Walk(const PairQuery& query, PairQueryResult& result)
      : Frames(query),
        shell_(*query.shell_A),
        margin_(query.margin),
        can_thin_(query.thin),
        voxel_(field_.voxel()),
        result_(result) {}

  void run(std::uint32_t levels) {
    if (!reaches(shell_.ballCentre(), shell_.ballRadius())) return;
    const std::uint32_t used =
        std::min<std::uint32_t>(levels, static_cast<std::uint32_t>(shell_.levels().size()));
    for (std::uint32_t k = 0; k < used; ++k) {
      const ShellLevel& level = shell_.levels()[k];
      for (std::uint32_t c = 0; c < level.cluster_count; ++c)
        walk(shell_.clusters()[level.first_cluster + c]);
    }
  }

  void setAreaScale(double scale) { area_scale_ = scale; }

 private:
  /// False when no point of the ball can be a contact; then its bound counts as the gap of its points.
  bool reaches(const Vector3& p_AC, double radius, bool look_closer = false) {
    ++result_.counts.spheres_visited;
    const Vector3 p_BC = inB(p_AC);
    const double need = radius + kSphereSlack + dilation_;
    double bound = field_.lowerBound(p_BC) - need;
    if (bound <= margin_ && look_closer) {
      // the interpolant at a point is above the true distance there less half a voxel's diagonal, that is
      // above the true distance here less the way; and so back to the interpolant here
      const FieldSample sample = field_.sample(p_BC);
      bound = sample.distance - (sample.exact ? 2.0 : 1.0) * kHalfDiagonal * voxel_ - need;
    }
    if (bound <= margin_) return true;
    result_.smallest_gap = std::min(result_.smallest_gap, bound);
    result_.others_gap = std::min(result_.others_gap, bound);
    return false;
  }

  void walk(const ShellSphere& cluster) {
    if (!reaches(cluster.p_MC.cast<double>(), cluster.radius)) return;
    for (std::uint32_t i = 0; i < cluster.count; ++i) {
      const ShellSphere& leaf = shell_.leaves()[cluster.first + i];
      if (reaches(leaf.p_MC.cast<double>(), leaf.radius, true)) test(leaf);
    }
  }

  void test(const ShellSphere& leaf) {
    Lanes lanes;
    const std::size_t count = std::min<std::size_t>(leaf.count, Pointshell::kLeafPoints);
    const std::span<const ShellPoint> points = shell_.points().subspan(leaf.first, count);
    sample(points, lanes);
    result_.counts.points_visited += static_cast<std::uint32_t>(count);

    LeafSubset near;
    for (std::uint32_t i = 0; i < count; ++i) {
      const FieldSample& sample = lanes.samples[i];
      const double gap = sample.distance - dilation_;
      result_.smallest_gap = std::min(result_.smallest_gap, gap);
      result_.deepest = std::max(result_.deepest, -sample.distance);
      if (gap < 0.0) ++result_.counts.points_colliding;
      if (sample.exact && gap <= margin_) {
        near.push_back(i);
      } else {
        result_.others_gap = std::min(result_.others_gap, gap);
      }
    }
    if (near.empty()) return;
    if (can_thin_) near = thinned(near, lanes);
    keep(leaf, points, lanes, near);
  }

  /// The kernel: everything that is done for a point whether or not it becomes a contact.
  void sample(std::span<const ShellPoint> points, Lanes& lanes) const {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector3 p = inB(points[i].p_MP.cast<double>());
      lanes.x[i] = p.x();
      lanes.y[i] = p.y();
      lanes.z[i] = p.z();
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      lanes.samples[i] = field_.sample(Vector3(lanes.x[i], lanes.y[i], lanes.z[i]));
    }
  }

  void keep(const ShellSphere& leaf, std::span<const ShellPoint> points, const Lanes& lanes,
            const LeafSubset& near) {
    if (leaf_count_ < leaf_starts_.size()) {
      leaf_starts_[leaf_count_++] = static_cast<std::uint32_t>(result_.contacts.size());
    }
    for (const std::uint32_t i : near) {
      Contact contact;
      setContact(points[i], lanes.samples[i], contact);
      contact.area = points[i].area * area_scale_;
      contact.point = leaf.first + i;
      add(contact);
    }
  }

  /// What of a leaf's points may be listed; makes room for them if that is possible.
  LeafSubset thinned(const LeafSubset& near, const Lanes& lanes) {
    LeafSubset chosen = near;
    while (true) {
      if (per_leaf_ < near.size()) {
        chosen = nearestOfEachDirection(
            near, per_leaf_, [&](std::uint32_t i) { return lanes.samples[i].distance; },
            [&](std::uint32_t i) -> const Vector3& { return lanes.samples[i].gradient; });
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

  const Pointshell& shell_;
  double margin_;
  bool can_thin_;
  double voxel_;
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
  walk.run(query.levels);

  if (result.counts.contacts_dropped > 0) {
    result.listed_to = result.contacts[0].gap;
    result.others_gap = std::min(result.others_gap, result.listed_to);
    // a heap's order would depend on what was dropped; the order of points never does
    std::sort(result.contacts.begin(), result.contacts.end(),
              [](const Contact& a, const Contact& b) { return a.point < b.point; });
  }
}

void resampleContacts(const PairQuery& query, double moved, PairQueryResult& result) noexcept {
  const Frames frames(query);
  const std::span<const ShellPoint> points = query.shell_A->points();
  ContactList& contacts = result.contacts;
  result.smallest_gap = result.others_gap - moved;
  result.deepest = std::max(-(result.smallest_gap + query.dilation), 0.0);
  std::uint32_t colliding = 0;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Contact contact = contacts[i];
    const ShellPoint& point = points[contact.point];
    const FieldSample sample = query.field_B->sample(frames.inB(point.p_MP.cast<double>()));
    frames.setContact(point, sample, contact);
    result.smallest_gap = std::min(result.smallest_gap, contact.gap);
    result.deepest = std::max(result.deepest, -sample.distance);
    if (contact.gap < 0.0) ++colliding;
    if (sample.exact) {
      contacts[kept++] = contact;
    } else {
      result.others_gap = std::min(result.others_gap, contact.gap);
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
