#include "server/bake/sweep.h"

#include <algorithm>
#include <cmath>

namespace tenon::bake {

namespace {

constexpr double kMaxSteps = 2e6;

/// The box of a body's field as a ball.
struct Extent {
  explicit Extent(const structures::DistanceField& field)
      : p_MQ(field.box().center()), radius(0.5 * field.box().diagonal().norm()) {}
  Vector3 p_MQ;
  double radius;  // [m]
};

/// Steps between two poses of a body of `extent`: no point of it moves by more than `step` [m].
double steps(const Pose& X_WM, const Pose& X_WM_next, const Extent& extent, double step) {
  const double length = maxPointMotion(displacement(X_WM, X_WM_next, extent.p_MQ), extent.radius);
  return std::max(1.0, std::ceil(length / step));
}

/// Calls visit(pose number, X_WM) along a path until visit returns false.
template <typename Visit>
Result<void> visitPath(std::span<const Pose> poses, const Extent& extent, double step,
                       const BakeProgress& progress, Visit&& visit) {
  if (poses.empty()) return fail("there is no pose");
  double total = 1.0;
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) total += steps(poses[i], poses[i + 1], extent, step);
  if (!(total < kMaxSteps)) return fail("the path is too long for so small a cell; choose a larger one");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (progress && !progress(static_cast<double>(i) / static_cast<double>(poses.size()), "sweeping")) {
      return fail("cancelled");
    }
    const bool last = i + 1 == poses.size();
    const double count = last ? 1.0 : steps(poses[i], poses[i + 1], extent, step);
    const Displacement motion = last ? Displacement{} : displacement(poses[i], poses[i + 1], extent.p_MQ);
    for (double k = 0.0; k < count; k += 1.0) {
      const double fraction = k / count;
      const Displacement part{motion.translation * fraction, motion.rotation * fraction};
      if (!visit(i, displaced(poses[i], part, extent.p_MQ))) return {};
    }
  }
  return {};
}

/// Whether a clearance is more than a lower bound of a positive distance.
bool certain(const Clearance& known) { return known.exact || known.distance < 0.0; }

/// Updates the minimum. A certain clearance replaces any that is only a bound.
void updateMinimum(Clearance& best, bool& any, const structures::FieldSample& sample, std::size_t pose,
                   const Vector3& p_WP) {
  const Clearance found{sample.distance, sample.exact, pose, p_WP};
  const bool better = certain(found) != certain(best) ? certain(found) : found.distance < best.distance;
  if (any && !better) return;
  any = true;
  best = found;
}

}  // namespace

Result<VoxelSet> sweep(const structures::HapticStructures& moved, std::span<const Pose> poses_WM,
                       const SweepOptions& options, const BakeProgress& progress) {
  if (moved.field.empty()) return fail("the body has no field");
  if (!(options.cell > 0.0) || !std::isfinite(options.cell)) return fail("cells must be larger than 0");
  if (!(options.dilation >= 0.0) || options.dilation > moved.field.band()) {
    return fail("the dilation must be 0 to " + std::to_string(moved.field.band()) +
                " m, the band of the body's field");
  }
  VoxelSet cells(options.cell);
  bool fits = true;
  const auto visited = visitPath(poses_WM, Extent(moved.field), options.cell / 2, progress,
                                 [&](std::size_t, const Pose& X_WM) {
                                   fits = cells.add(moved.field, X_WM, options.dilation);
                                   return fits;
                                 });
  if (!visited) return tl::unexpected(visited.error());
  if (!fits) return fail("the cells do not fit into memory; choose larger ones");
  return cells;
}

Result<Clearance> clearance(const structures::HapticStructures& moved, std::span<const Pose> poses_WM,
                            const structures::DistanceField& scene_W, double step,
                            const BakeProgress& progress) {
  if (moved.shell.empty() || moved.field.empty()) return fail("the body has no shell");
  if (!(step > 0.0)) return fail("steps must be longer than 0");
  if (scene_W.empty()) return fail("the scene has no field");
  Clearance best;
  bool any = false;
  const structures::Pointshell& shell = moved.shell;
  const auto beyond = [&](const structures::ShellSphere& sphere, const Pose& X_WM) {
    if (!any) return false;
    // a mere bound may still be replaced by any distance within the band
    const double limit = certain(best) ? best.distance : std::max(best.distance, scene_W.band());
    return scene_W.lowerBound(X_WM * sphere.p_MC.cast<double>(), sphere.radius) > limit;
  };
  const auto visited =
      visitPath(poses_WM, Extent(moved.field), step, progress, [&](std::size_t pose, const Pose& X_WM) {
        for (const structures::ShellSphere& cluster : shell.clusters()) {
          if (beyond(cluster, X_WM)) continue;
          for (const structures::ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
            if (beyond(leaf, X_WM)) continue;
            for (const structures::ShellPoint& point : shell.points().subspan(leaf.first, leaf.count)) {
              const Vector3 p_WP = X_WM * point.p_MP.cast<double>();
              updateMinimum(best, any, scene_W.undilated(p_WP), pose, p_WP);
            }
          }
        }
        return true;
      });
  if (!visited) return tl::unexpected(visited.error());
  return best;
}

}  // namespace tenon::bake
