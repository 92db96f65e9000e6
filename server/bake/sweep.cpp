#include "server/bake/sweep.h"

#include <algorithm>
#include <cmath>

namespace tenon {

namespace {

constexpr double kMaxSteps = 2e6;

double steps(const Pose& X_WA, const Pose& X_WB, double radius, double step) {
  return std::max(1.0, std::ceil(fastestPoint(displacement(X_WA, X_WB), radius) / step));
}

/// Calls visit(pose number, X_WM) along a way; visit says whether to go on.
template <typename Visit>
Result<void> walk(std::span<const Pose> poses, double radius, double step, const BakeProgress& progress,
                  Visit&& visit) {
  if (poses.empty()) return fail("there is no pose");
  double all = 1.0;
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) all += steps(poses[i], poses[i + 1], radius, step);
  if (!(all < kMaxSteps))
    return fail("the way is too long for steps of so small a cell; choose a larger one");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (progress && !progress(static_cast<double>(i) / static_cast<double>(poses.size()), "sweeping")) {
      return fail("cancelled");
    }
    const bool last = i + 1 == poses.size();
    const double count = last ? 1.0 : steps(poses[i], poses[i + 1], radius, step);
    const Displacement motion = last ? Displacement{} : displacement(poses[i], poses[i + 1]);
    for (double k = 0.0; k < count; k += 1.0) {
      const double share = k / count;
      const Displacement part{motion.translation * share, motion.rotation * share};
      if (!visit(i, displaced(poses[i], part))) return {};
    }
  }
  return {};
}

/// The furthest corner of the field's box from the origin: no point of the body turns on a larger circle.
double radiusOf(const DistanceField& field) {
  return field.box().min().cwiseAbs().cwiseMax(field.box().max().cwiseAbs()).norm();
}

bool certain(const Clearance& known) { return known.exact || known.distance < 0.0; }

/// Keeps the worst point. A bound counts only while nothing is known better.
void consider(Clearance& best, bool& any, const FieldSample& sample, std::size_t pose, const Vector3& p_WP) {
  const Clearance found{sample.distance, sample.exact, pose, p_WP};
  const bool better = certain(found) != certain(best) ? certain(found) : found.distance < best.distance;
  if (any && !better) return;
  any = true;
  best = found;
}

}  // namespace

Result<VoxelSet> sweep(const HapticStructures& moved, std::span<const Pose> poses_WM,
                       const SweepOptions& options, const BakeProgress& progress) {
  if (moved.field.empty()) return fail("the body has no field");
  if (!(options.cell > 0.0) || !std::isfinite(options.cell)) return fail("cells must be larger than 0");
  if (!(options.grow >= 0.0) || options.grow > moved.field.band()) {
    return fail("a body can be grown by 0 to " + std::to_string(moved.field.band()) +
                " m, the band of its field");
  }
  VoxelSet cells(options.cell);
  bool room = true;
  const auto walked =
      walk(poses_WM, radiusOf(moved.field), options.cell / 2, progress, [&](std::size_t, const Pose& X_WM) {
        room = cells.add(moved.field, X_WM, options.grow);
        return room;
      });
  if (!walked) return tl::unexpected(walked.error());
  if (!room) return fail("so many cells do not fit into memory; choose larger ones");
  return cells;
}

Result<Clearance> clearance(const HapticStructures& moved, std::span<const Pose> poses_WM,
                            const DistanceField& scene_W, double step, const BakeProgress& progress) {
  if (moved.shell.empty() || moved.field.empty()) return fail("the body has no shell");
  if (!(step > 0.0)) return fail("steps must be longer than 0");
  if (scene_W.empty()) return fail("the scene has no field");
  Clearance best;
  bool any = false;
  const Pointshell& shell = moved.shell;
  const auto beyond = [&](const ShellSphere& ball, const Pose& X_WM) {
    if (!any) return false;
    // a bound may still be replaced by anything in the band
    const double enough = certain(best) ? best.distance : std::max(best.distance, scene_W.band());
    return scene_W.lowerBound(X_WM * ball.p_MC.cast<double>(), ball.radius) > enough;
  };
  const auto walked =
      walk(poses_WM, radiusOf(moved.field), step, progress, [&](std::size_t pose, const Pose& X_WM) {
        for (const ShellSphere& cluster : shell.clusters()) {
          if (beyond(cluster, X_WM)) continue;
          for (const ShellSphere& leaf : shell.leaves().subspan(cluster.first, cluster.count)) {
            if (beyond(leaf, X_WM)) continue;
            for (const ShellPoint& point : shell.points().subspan(leaf.first, leaf.count)) {
              const Vector3 p_WP = X_WM * point.p_MP.cast<double>();
              consider(best, any, scene_W.sample(p_WP), pose, p_WP);
            }
          }
        }
        return true;
      });
  if (!walked) return tl::unexpected(walked.error());
  return best;
}

}  // namespace tenon
