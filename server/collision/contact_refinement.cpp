#include "server/collision/contact_refinement.h"

#include <algorithm>
#include <cmath>

#include "server/collision/contact_blocks.h"
#include "server/collision/query_kernels.h"

namespace tenon::collision {

namespace {

/// [-] A gradient counts as of unit length if its square is this near to 1; quantised samples alone cause
/// such a deviation.
constexpr double kUnitTolerance = 2e-3;

struct NonUnitContact {
  std::uint32_t contact;  // index in the list
  double gap;             // [m]
  Vector3 p_BP;

  bool operator<(const NonUnitContact& other) const {
    return gap != other.gap ? gap < other.gap : contact < other.contact;
  }
};
using NonUnitContacts = FixedVector<NonUnitContact, kMaxPairContacts>;

/// Collects the contacts at which the field's gradient is not of unit length.
void findNonUnitGradients(const LaneFrame& frame, const structures::Pointshell& shell,
                          const ContactList& contacts, NonUnitContacts& non_unit) {
  for (std::size_t first = 0; first < contacts.size(); first += structures::ShellBlock::kLanes) {
    const structures::ShellBlock block = blockOf(shell, {contacts.begin(), contacts.size()}, first);
    SampleLanes lanes;
    SampleSums sums;
    const PointLanes points{block.x.data(), block.y.data(), block.z.data(), block.count};
    chosenKernels().samples(frame, points, &lanes, sums);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const Vector3 gradient(lanes.gradient_x[i], lanes.gradient_y[i], lanes.gradient_z[i]);
      if (std::abs(gradient.squaredNorm() - 1.0) < kUnitTolerance) continue;
      const auto index = static_cast<std::uint32_t>(first + i);
      const Vector3 p_AP = shell.points()[contacts[index].point].p_MP.cast<double>();
      non_unit.push_back({index, contacts[index].gap, frame.inB(p_AP)});
    }
  }
}

/// Sign of the distance at P: +1 outside, -1 inside; Q is the nearest point of the surface. The field's sign
/// is right where its distance exceeds the interpolation error. Elsewhere the field is compared one voxel
/// beyond P and one voxel beyond Q, away from each other: the larger distance is outside, also behind a thin
/// wall.
double signAt(const structures::DistanceField& field, const Vector3& p_BP, const Vector3& p_BQ,
              double field_distance) {
  const double voxel = field.voxelAt(p_BQ);
  if (std::abs(field_distance) > structures::DistanceField::kHalfDiagonal * voxel)
    return field_distance > 0.0 ? 1.0 : -1.0;
  const Vector3 away = (p_BP - p_BQ).normalized() * voxel;
  return field.undilated(p_BP + away).distance >= field.undilated(p_BQ - away).distance ? 1.0 : -1.0;
}

/// Adds a contact to the counts and sums of the query, or subtracts it.
void updateSums(const PairQuery& query, const Contact& contact, bool add, PairQueryResult& result) {
  if (contact.gap >= 0.0) return;
  result.counts.points_colliding += add ? 1U : ~0U;
  if (!query.sum_penalty) return;
  const Vector3 f = (add ? 1.0 : -1.0) * penaltyForce(contact, 1.0) * contact.n_W;
  result.penalty_Ao_W += {f, (contact.p_WP - query.X_WA.translation()).cross(f)};
  result.penalty_points += add ? 1U : ~0U;
}

}  // namespace

RefinementCounts refineContacts(const PairQuery& query, const structures::SurfaceTree& surface_B,
                                const RefinementBudget& budget, PairQueryResult& result) noexcept {
  RefinementCounts counts;
  const structures::DistanceField& field = *query.field_B;
  const LaneFrame frame(field, query.X_WA, query.X_WB, query.margin, query.shell_A->radius());
  NonUnitContacts non_unit;
  findNonUnitGradients(frame, *query.shell_A, result.contacts, non_unit);
  const auto refined = static_cast<std::ptrdiff_t>(std::min<std::size_t>(budget.contacts, non_unit.size()));
  std::partial_sort(non_unit.begin(), non_unit.begin() + refined, non_unit.end());

  std::uint32_t triangles_left = budget.triangles;
  for (const NonUnitContact* next = non_unit.begin();
       next != non_unit.begin() + refined && triangles_left > 0; ++next) {
    const double dilation = field.dilationAt(next->p_BP);
    const double field_distance = next->gap + dilation;
    const double reach =
        std::abs(field_distance) + structures::DistanceField::kHalfDiagonal * field.voxelAt(next->p_BP);
    const structures::SurfaceTree::Nearest nearest = surface_B.nearest(next->p_BP, reach, triangles_left);
    if (!nearest.found) continue;
    ++counts.contacts;
    Contact& contact = result.contacts[next->contact];
    updateSums(query, contact, false, result);
    contact.gap = -dilation;
    constexpr double kOnSurface = 1e-9;  // [m] no direction can be computed nearer; the field's normal stays
    if (nearest.distance > kOnSurface) {
      const double sign = signAt(field, next->p_BP, nearest.p_MQ, field_distance);
      contact.gap += sign * nearest.distance;
      contact.n_W = rotated(frame.R_WB, sign / nearest.distance * (next->p_BP - nearest.p_MQ));
    }
    updateSums(query, contact, true, result);
  }
  counts.triangles = budget.triangles - triangles_left;

  if (counts.contacts == 0) return counts;
  result.smallest_gap = result.unlisted_gap;
  for (const Contact& contact : result.contacts)
    result.smallest_gap = std::min(result.smallest_gap, contact.gap);
  result.deepest = std::max(-result.smallest_gap, 0.0);
  return counts;
}

}  // namespace tenon::collision
