#include "tests/support/contact_errors.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tenon::test {

void ContactErrors::add(const collision::PairQuery& query, const collision::PairQueryResult& result,
                        const SolidUnion& truth_B) {
  constexpr double kNear = 0.003;  // [m] points that are farther by the field are not inside
  constexpr double kReferenceArea = 1e-4;
  constexpr double kNotListed = 1e9;
  const auto points = query.shell_A->points();
  const Pose X_BA = query.X_WB.inverse() * query.X_WA;
  std::vector<double> listed(points.size(), kNotListed);
  for (const collision::Contact& contact : result.contacts)
    if (contact.kind == collision::ContactKind::kShellPoint) listed[contact.point] = contact.gap;
  Vector3 force_B = Vector3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3 p_BP = X_BA * points[i].p_MP.cast<double>();
    if (query.field_B->lowerBound(p_BP) > kNear) continue;
    const auto nearest = truth_B.nearest(p_BP);
    const double distance = (truth_B.inside(p_BP) ? -1.0 : 1.0) * nearest.distance;
    const double gap = distance - query.field_B->dilationAt(p_BP);
    if (gap < 0.0) {
      ++points_inside_;
      const double reported_gap = listed[i] == kNotListed ? query.field_B->sample(p_BP).distance : listed[i];
      if (reported_gap > 0.0) ++missed_;
      // along the outward gradient of the distance
      if (distance != 0.0)
        force_B +=
            static_cast<double>(points[i].area) / kReferenceArea * (gap / distance) * (nearest.p_MQ - p_BP);
    }
    if (listed[i] <= listed_to_) depth_.push_back(std::abs(listed[i] - gap));
  }
  const Vector3 reported_force_B = query.X_WB.rotation().conjugate() * result.penalty_Ao_W.force;
  if (force_B.norm() > 0.0) force_.push_back((reported_force_B - force_B).norm() / force_B.norm());
}

double ContactErrors::missed() const {
  return static_cast<double>(missed_) / static_cast<double>(std::max<std::size_t>(points_inside_, 1));
}

double ContactErrors::quantileOf(std::vector<double> values, double quantile) {
  if (values.empty()) return 1e9;
  const auto position = static_cast<std::size_t>(quantile * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(position), values.end());
  return values[position];
}

std::string ContactErrors::text() const {
  char line[256];
  std::snprintf(line, sizeof line,
                "%zu points inside: depth error median %.5f mm, p99 %.4f mm; %.2f %% missed; net force error "
                "median %.2f %%",
                points_inside_, 1e3 * depth(0.5), 1e3 * depth(0.99), 100.0 * missed(), 100.0 * force(0.5));
  return line;
}

}  // namespace tenon::test
