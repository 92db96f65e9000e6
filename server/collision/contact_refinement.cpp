#include "server/collision/contact_refinement.h"

#include <algorithm>
#include <cmath>

#include "server/collision/contact_blocks.h"
#include "server/collision/query_kernels.h"

namespace tenon {

namespace {

/// A slope whose square is as near to one is that of a distance; samples alone round it by as much.
constexpr double kBend = 2e-3;

struct Bent {
  std::uint32_t contact;
  double gap;
  Vector3 p_BP;

  bool operator<(const Bent& other) const {
    return gap != other.gap ? gap < other.gap : contact < other.contact;
  }
};
using BentContacts = FixedVector<Bent, kMaxPairContacts>;

/// The contacts at which the field bends.
void findBent(const LaneFrame& frame, const Pointshell& shell, const ContactList& contacts,
              BentContacts& bent) {
  for (std::size_t first = 0; first < contacts.size(); first += ShellBlock::kLanes) {
    const ShellBlock block = blockOf(shell, contacts, first);
    SampleLanes lanes;
    SampleSums sums;
    const PointLanes places{block.x.data(), block.y.data(), block.z.data(), block.count};
    chosenKernels().samples(frame, places, &lanes, sums);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const Vector3 gradient(lanes.gradient_x[i], lanes.gradient_y[i], lanes.gradient_z[i]);
      if (std::abs(gradient.squaredNorm() - 1.0) < kBend) continue;
      const auto number = static_cast<std::uint32_t>(first + i);
      const Vector3 p_AP = shell.points()[contacts[number].point].p_MP.cast<double>();
      bent.push_back({number, contacts[number].gap, frame.inB(p_AP)});
    }
  }
}

/// +1 outside, -1 inside. Farther from zero than interpolation errs the field's own sign is right. Nearer it
/// may not be, but a voxel to either side of the surface it is; behind a thin wall the one that is farther
/// from zero still tells.
double sideOf(const DistanceField& field, const Vector3& p_BP, const Vector3& p_BQ, double by_field) {
  const double voxel = field.voxelAt(p_BQ);
  if (std::abs(by_field) > DistanceField::kHalfDiagonal * voxel) return by_field > 0.0 ? 1.0 : -1.0;
  const Vector3 away = (p_BP - p_BQ).normalized() * voxel;
  return field.sample(p_BP + away).distance >= field.sample(p_BQ - away).distance ? 1.0 : -1.0;
}

/// Takes a contact out of what the query summed, or puts it in.
void count(const PairQuery& query, const Contact& contact, bool in, PairQueryResult& result) {
  if (contact.gap >= 0.0) return;
  result.counts.points_colliding += in ? 1U : ~0U;
  if (!query.sum) return;
  const Vector3 f = (in ? 1.0 : -1.0) * penaltyForce(contact, 1.0) * contact.n_W;
  result.push_Ao_W += {f, (contact.p_WP - query.X_WA.translation()).cross(f)};
  result.pushing += in ? 1U : ~0U;
}

}  // namespace

RefinementCounts refineContacts(const PairQuery& query, const SurfaceTree& surface_B,
                                const RefinementBudget& budget, PairQueryResult& result) noexcept {
  RefinementCounts counts;
  const DistanceField& field = *query.field_B;
  const LaneFrame frame(field, query.X_WA, query.X_WB, query.dilation, query.margin, query.shell_A->radius());
  BentContacts bent;
  findBent(frame, *query.shell_A, result.contacts, bent);
  const auto wanted = static_cast<std::ptrdiff_t>(std::min<std::size_t>(budget.contacts, bent.size()));
  std::partial_sort(bent.begin(), bent.begin() + wanted, bent.end());

  std::uint32_t left = budget.triangles;
  for (const Bent* next = bent.begin(); next != bent.begin() + wanted && left > 0; ++next) {
    const double by_field = next->gap + query.dilation;
    const double reach = std::abs(by_field) + DistanceField::kHalfDiagonal * field.voxelAt(next->p_BP);
    const SurfaceTree::Nearest nearest = surface_B.nearest(next->p_BP, reach, left);
    if (!nearest.found) continue;
    ++counts.contacts;
    Contact& contact = result.contacts[next->contact];
    count(query, contact, false, result);
    contact.gap = -query.dilation;
    constexpr double kOnSurface = 1e-9;  // [m] nearer there is no direction; the field's normal stays
    if (nearest.distance > kOnSurface) {
      const double side = sideOf(field, next->p_BP, nearest.p_MQ, by_field);
      contact.gap += side * nearest.distance;
      contact.n_W = turned(frame.R_WB, side / nearest.distance * (next->p_BP - nearest.p_MQ));
    }
    count(query, contact, true, result);
  }
  counts.triangles = budget.triangles - left;

  if (counts.contacts == 0) return counts;
  result.smallest_gap = result.others_gap;
  for (const Contact& contact : result.contacts)
    result.smallest_gap = std::min(result.smallest_gap, contact.gap);
  result.deepest = std::max(-(result.smallest_gap + query.dilation), 0.0);
  return counts;
}

}  // namespace tenon
