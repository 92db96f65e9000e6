#include "server/simulation/work_budget.h"

#include <algorithm>

namespace tenon {
namespace {

/// Who hardly touched keeps this much of its worst-case share: enough to notice that it touches.
constexpr double kLeastOfShare = 0.1;

double skinOf(const Vector3& sides) {
  return 2.0 * (sides.x() * sides.y() + sides.y() * sides.z() + sides.z() * sides.x());
}

Vector3 sorted(Vector3 sides) {
  std::sort(sides.begin(), sides.end());
  return sides;
}

double worstCaseOf(const Pointshell& shell, const DistanceField& field) {
  if (shell.empty() || field.empty()) return 0.0;
  Eigen::AlignedBox3d box;
  for (const ShellPoint& point : shell.points()) box.extend(point.p_MP.cast<double>());
  // the largest box that fits into both, however they are turned
  const Vector3 sides = sorted(box.sizes());
  const Vector3 common = sides.cwiseMin(sorted(field.box().sizes()));
  const double skin = skinOf(sides);
  const double share = skin > 0.0 ? skinOf(common) / skin : 1.0;
  return share * static_cast<double>(shell.points().size());
}

}  // namespace

WorkBudget::WorkBudget(const Scene& scene, std::size_t rooms)
    : wanted_(rooms, 0.0), shares_(rooms, kUnlimited) {
  worst_.reserve(scene.pairs.size());
  // of 20,000 pairs most are of the same few shapes
  const HapticStructures* last_a = nullptr;
  const HapticStructures* last_b = nullptr;
  double last = 0.0;
  for (const PairSpec& pair : scene.pairs) {
    const HapticStructures* a = scene.objects[pair.a.value].structures.get();
    const HapticStructures* b = scene.objects[pair.b.value].structures.get();
    if (a != last_a || b != last_b) {
      last = a != nullptr && b != nullptr ? worstCaseOf(a->shell, b->field) : 0.0;
      last_a = a;
      last_b = b;
    }
    worst_.push_back(last);
  }
}

void WorkBudget::share(const WorkLimits& limits, std::span<const std::uint32_t> due,
                       std::span<const CollPair> pairs) noexcept {
  if (!limits.any()) {
    std::fill_n(shares_.begin(), due.size(), kUnlimited);
    return;
  }
  double sum = 0.0;
  for (std::size_t slot = 0; slot < due.size(); ++slot) {
    const CollPair& pair = pairs[due[slot]];
    // of one that was never looked at the worst is expected
    const double load = pair.looked() ? pair.wholeLoad() / limits.critical_load : 1.0;
    wanted_[slot] = worst_[due[slot]] * std::clamp(load, kLeastOfShare, 1.0);
    sum += wanted_[slot];
  }
  for (std::size_t slot = 0; slot < due.size(); ++slot) {
    const double points = static_cast<double>(limits.points) * (wanted_[slot] / std::max(sum, 1.0));
    shares_[slot] = static_cast<std::uint32_t>(std::clamp(points, 1.0, kUnlimited - 1.0));
  }
}

}  // namespace tenon
