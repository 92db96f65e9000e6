#include "server/simulation/work_budget.h"

#include <algorithm>

namespace tenon::simulation {
namespace {

/// [-] A pair that is hardly in contact keeps this fraction of its worst case: enough to detect new contact.
constexpr double kMinFraction = 0.1;

/// [m^2] of a box's surface.
double surfaceArea(const Vector3& sides) {
  return 2.0 * (sides.x() * sides.y() + sides.y() * sides.z() + sides.z() * sides.x());
}

Vector3 sorted(Vector3 sides) {
  std::sort(sides.begin(), sides.end());
  return sides;
}

double worstCaseOf(const structures::Pointshell& shell, const structures::DistanceField& field) {
  if (shell.empty() || field.empty()) return 0.0;
  Eigen::AlignedBox3d box;
  for (const structures::ShellPoint& point : shell.points()) box.extend(point.p_MP.cast<double>());
  // the largest box that fits into both at any relative orientation
  const Vector3 sides = sorted(box.sizes());
  const Vector3 common = sides.cwiseMin(sorted(field.box().sizes()));
  const double area = surfaceArea(sides);
  const double fraction = area > 0.0 ? surfaceArea(common) / area : 1.0;
  return fraction * static_cast<double>(shell.points().size());
}

}  // namespace

WorkBudget::WorkBudget(const Scene& scene, std::size_t max_due)
    : weights_(max_due, 0.0), budgets_(max_due, kUnlimited) {
  worst_case_.reserve(scene.pairs.size());
  // neighbouring pairs of large scenes often have the same two shapes
  const structures::HapticStructures* last_a = nullptr;
  const structures::HapticStructures* last_b = nullptr;
  double last = 0.0;
  for (const PairSpec& pair : scene.pairs) {
    const structures::HapticStructures* a = scene.objects[pair.a.value].structures.get();
    const structures::HapticStructures* b = scene.objects[pair.b.value].structures.get();
    if (a != last_a || b != last_b) {
      last = a != nullptr && b != nullptr ? worstCaseOf(a->shell, b->field) : 0.0;
      last_a = a;
      last_b = b;
    }
    worst_case_.push_back(last);
  }
}

void WorkBudget::distribute(const WorkLimits& limits, std::span<const std::uint32_t> due,
                            std::span<const CollPair> pairs) noexcept {
  if (!limits.any()) {
    std::fill_n(budgets_.begin(), due.size(), kUnlimited);
    return;
  }
  double sum = 0.0;
  for (std::size_t slot = 0; slot < due.size(); ++slot) {
    const CollPair& pair = pairs[due[slot]];
    // a pair without a query since its reset is given its worst case
    const double load = pair.queried() ? pair.loadAtAllLevels() / limits.critical_load : 1.0;
    weights_[slot] = worst_case_[due[slot]] * std::clamp(load, kMinFraction, 1.0);
    sum += weights_[slot];
  }
  for (std::size_t slot = 0; slot < due.size(); ++slot) {
    const double points = static_cast<double>(limits.points) * (weights_[slot] / std::max(sum, 1.0));
    budgets_[slot] = static_cast<std::uint32_t>(std::clamp(points, 1.0, kUnlimited - 1.0));
  }
}

}  // namespace tenon::simulation
