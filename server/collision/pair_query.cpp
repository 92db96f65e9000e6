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

/// The points of one leaf, as lanes: seen in M of the field, and what the field says there.
struct Lanes {
  std::array<double, Pointshell::kLeafPoints> x, y, z;
  std::array<FieldSample, Pointshell::kLeafPoints> samples;
};

bool smallerGap(const Contact& a, const Contact& b) {
  return a.gap != b.gap ? a.gap < b.gap : a.point < b.point;
}

/// One walk over a shell: what stays the same from sphere to sphere.
class Walk {
 public:
  Walk(const PairQuery& query, PairQueryResult& result)
      : field_(*query.field_B),
        shell_(*query.shell_A),
        dilation_(query.dilation),
        margin_(query.margin),
        R_WA_(query.X_WA.matrix()),
        R_WB_(query.X_WB.matrix()),
        p_WA_(query.X_WA.translation()),
        result_(result) {
    const Pose X_BA = query.X_WB.inverse() * query.X_WA;
    R_BA_ = X_BA.matrix();
    p_BA_B_ = X_BA.translation();
  }

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
  bool reaches(const Vector3& p_AC, double radius) {
    ++result_.counts.spheres_visited;
    const double bound = field_.lowerBound(p_BA_B_ + R_BA_ * p_AC) - radius - kSphereSlack - dilation_;
    if (bound <= margin_) return true;
    result_.smallest_gap = std::min(result_.smallest_gap, bound);
    return false;
  }

  void walk(const ShellSphere& cluster) {
    if (!reaches(cluster.p_MC.cast<double>(), cluster.radius)) return;
    for (std::uint32_t i = 0; i < cluster.count; ++i) {
      const ShellSphere& leaf = shell_.leaves()[cluster.first + i];
      if (reaches(leaf.p_MC.cast<double>(), leaf.radius)) test(leaf);
    }
  }

  void test(const ShellSphere& leaf) {
    Lanes lanes;
    const std::size_t count = std::min<std::size_t>(leaf.count, Pointshell::kLeafPoints);
    const std::span<const ShellPoint> points = shell_.points().subspan(leaf.first, count);
    sample(points, lanes);
    result_.counts.points_visited += static_cast<std::uint32_t>(count);
    for (std::size_t i = 0; i < count; ++i)
      keep(points[i], leaf.first + static_cast<std::uint32_t>(i), lanes.samples[i]);
  }

  /// The kernel: everything that is done for a point whether or not it becomes a contact.
  void sample(std::span<const ShellPoint> points, Lanes& lanes) const {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector3 p = p_BA_B_ + R_BA_ * points[i].p_MP.cast<double>();
      lanes.x[i] = p.x();
      lanes.y[i] = p.y();
      lanes.z[i] = p.z();
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      lanes.samples[i] = field_.sample(Vector3(lanes.x[i], lanes.y[i], lanes.z[i]));
    }
  }

  void keep(const ShellPoint& point, std::uint32_t index, const FieldSample& sample) {
    const double gap = sample.distance - dilation_;
    result_.smallest_gap = std::min(result_.smallest_gap, gap);
    result_.deepest = std::max(result_.deepest, -sample.distance);
    if (gap < 0.0) ++result_.counts.points_colliding;
    if (!sample.exact || gap > margin_) return;
    Contact contact;
    contact.p_WP = p_WA_ + R_WA_ * point.p_MP.cast<double>();
    contact.gap = gap;
    contact.area = point.area * area_scale_;
    contact.point = index;
    // B pushes A out along its own normal or, where it has none, into A's own inside
    const double slope = sample.gradient.norm();
    contact.n_W = slope >= kLeastGradient ? Vector3(R_WB_ * (sample.gradient / slope))
                                          : Vector3(R_WA_ * point.inward_M.cast<double>()).normalized();
    add(contact);
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

  const DistanceField& field_;
  const Pointshell& shell_;
  double dilation_;
  double margin_;
  double area_scale_ = 1.0;
  Matrix3 R_WA_, R_WB_, R_BA_;
  Vector3 p_WA_, p_BA_B_;
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
    // a heap's order would depend on what was dropped; the order of points never does
    std::sort(result.contacts.begin(), result.contacts.end(),
              [](const Contact& a, const Contact& b) { return a.point < b.point; });
  }
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
