#include "server/structures/shell_builder.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "server/structures/point_grid.h"

namespace tenon::structures {

namespace {

// About how many points the coarsest level has.
constexpr double kCoarsestPoints = 32.0;

/// The numbers of the samples that each level adds, in their order.
std::vector<std::vector<std::uint32_t>> sortIntoLevels(std::span<const SurfaceSample> samples,
                                                       double spacing) {
  const double ratio = static_cast<double>(samples.size()) / kCoarsestPoints;
  const int levels = ratio <= 1.0 ? 1 : 1 + static_cast<int>(std::log2(ratio) / 2.0);
  std::vector<std::vector<std::uint32_t>> added(static_cast<std::size_t>(levels));
  std::vector<bool> taken(samples.size(), false);
  for (int level = 0; level < levels; ++level) {
    const bool last = level == levels - 1;
    const double apart = spacing * std::exp2(levels - 1 - level);
    PointGrid grid(apart);
    for (std::uint32_t i = 0; !last && i < samples.size(); ++i) {
      if (taken[i]) grid.add(samples[i].p_MP, i);
    }
    for (std::uint32_t i = 0; i < samples.size(); ++i) {
      if (taken[i]) continue;
      const SurfaceSample& sample = samples[i];
      const bool free = last || grid.visitNear(sample.p_MP, [&](std::uint32_t other, double squared) {
        return squared >= apart * apart || samples[other].inward_M.dot(sample.inward_M) < 0.0;
      });
      if (!free) continue;
      taken[i] = true;
      added[static_cast<std::size_t>(level)].push_back(i);
      if (!last) grid.add(sample.p_MP, i);
    }
  }
  std::erase_if(added, [](const auto& level) { return level.empty(); });
  return added;
}

/// Orders numbers so that every run of 16, and of 256, is spatially compact: median splits at multiples of
/// the run length.
void sortIntoRuns(std::span<const SurfaceSample> samples, std::span<std::uint32_t> numbers) {
  constexpr std::size_t kLeaf = Pointshell::kLeafPoints;
  constexpr std::size_t kCluster = kLeaf * Pointshell::kClusterLeaves;
  if (numbers.size() <= kLeaf) return;
  Eigen::AlignedBox3d box;
  for (const std::uint32_t i : numbers) box.extend(samples[i].p_MP);
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const std::size_t run = numbers.size() > kCluster ? kCluster : kLeaf;
  const std::size_t half = (numbers.size() / run + 1) / 2 * run;
  const std::size_t middle = half < numbers.size() ? half : run;
  std::nth_element(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(middle), numbers.end(),
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double pa = samples[a].p_MP[axis];
                     const double pb = samples[b].p_MP[axis];
                     return pa != pb ? pa < pb : a < b;
                   });
  sortIntoRuns(samples, numbers.first(middle));
  sortIntoRuns(samples, numbers.subspan(middle));
}

/// A bounding sphere of points: its centre starts at the box's centre and moves towards the furthest point in
/// 32 decreasing steps; the smallest radius found is taken (Badoiu and Clarkson 2003). The radius is rounded
/// up to bound every point in float arithmetic.
ShellSphere boundingSphere(std::span<const ShellPoint> points) {
  Eigen::AlignedBox3f box;
  for (const ShellPoint& point : points) box.extend(point.p_MP);
  const auto furthest = [&points](const Vector3f& centre) {
    return std::max_element(points.begin(), points.end(), [&](const ShellPoint& a, const ShellPoint& b) {
      return (a.p_MP - centre).squaredNorm() < (b.p_MP - centre).squaredNorm();
    });
  };
  ShellSphere sphere;
  sphere.p_MC = box.center();
  sphere.radius = (furthest(sphere.p_MC)->p_MP - sphere.p_MC).norm();
  Vector3f centre = sphere.p_MC;
  for (int step = 1; step <= 32; ++step) {
    const auto far = furthest(centre);
    const float radius = (far->p_MP - centre).norm();
    if (radius < sphere.radius) {
      sphere.radius = radius;
      sphere.p_MC = centre;
    }
    centre += (far->p_MP - centre) / static_cast<float>(step + 1);
  }
  sphere.radius = sphere.radius * 1.00001F + 1e-7F * sphere.p_MC.norm();
  return sphere;
}

/// Appends a level with the samples `numbers`, which are sorted into runs.
ShellLevel appendLevel(ShellStorage& storage, std::span<const SurfaceSample> samples,
                       std::span<const std::uint32_t> numbers) {
  ShellLevel level;
  level.first_point = static_cast<std::uint32_t>(storage.points.size());
  level.first_leaf = static_cast<std::uint32_t>(storage.leaves.size());
  level.first_cluster = static_cast<std::uint32_t>(storage.clusters.size());
  level.point_count = static_cast<std::uint32_t>(numbers.size());
  for (const std::uint32_t i : numbers) {
    storage.points.push_back({samples[i].p_MP.cast<float>(), samples[i].inward_M.cast<float>(),
                              static_cast<float>(samples[i].area)});
  }
  const std::span<const ShellPoint> points = std::span(storage.points).subspan(level.first_point);
  constexpr std::uint32_t kLeaf = Pointshell::kLeafPoints;
  constexpr std::uint32_t kCluster = kLeaf * Pointshell::kClusterLeaves;
  for (std::uint32_t first = 0; first < level.point_count; first += kLeaf) {
    const std::uint32_t count = std::min(kLeaf, level.point_count - first);
    ShellSphere leaf = boundingSphere(points.subspan(first, count));
    leaf.first = level.first_point + first;
    leaf.count = count;
    storage.leaves.push_back(leaf);
  }
  level.leaf_count = static_cast<std::uint32_t>(storage.leaves.size()) - level.first_leaf;
  for (std::uint32_t first = 0; first < level.point_count; first += kCluster) {
    const std::uint32_t count = std::min(kCluster, level.point_count - first);
    ShellSphere cluster = boundingSphere(points.subspan(first, count));
    cluster.first = level.first_leaf + first / kLeaf;
    cluster.count = (count + kLeaf - 1) / kLeaf;
    storage.clusters.push_back(cluster);
  }
  level.cluster_count = static_cast<std::uint32_t>(storage.clusters.size()) - level.first_cluster;
  return level;
}

}  // namespace

Pointshell makeShell(ShellStorage storage) {
  const auto owner = std::make_shared<const ShellStorage>(std::move(storage));
  return {owner->layout(), owner};
}

FeatureShell makeFeatureShell(FeatureStorage storage) {
  auto edges = std::make_shared<const HugeVector<FeatureEdge>>(std::move(storage.edges));
  return {makeShell(std::move(storage.points)), *edges, edges};
}

Pointshell buildShell(std::span<const SurfaceSample> samples, double spacing) {
  if (samples.empty()) return {};
  const double area =
      std::accumulate(samples.begin(), samples.end(), 0.0,
                      [](double sum, const SurfaceSample& sample) { return sum + sample.area; });
  if (spacing <= 0.0) spacing = std::sqrt(area / static_cast<double>(samples.size()));
  if (spacing <= 0.0) spacing = 1e-3;

  ShellStorage storage;
  auto added = sortIntoLevels(samples, spacing);
  double used_area = 0.0;
  for (std::size_t k = 0; k < added.size(); ++k) {
    sortIntoRuns(samples, added[k]);
    for (const std::uint32_t i : added[k]) used_area += samples[i].area;
    ShellLevel level = appendLevel(storage, samples, added[k]);
    level.spacing = static_cast<float>(spacing * std::exp2(added.size() - 1 - k));
    level.area_scale = used_area > 0.0 ? static_cast<float>(area / used_area) : 1.0F;
    storage.levels.push_back(level);
  }
  return makeShell(std::move(storage));
}

ShellStorage buildFlatShell(std::span<const SurfaceSample> samples, double spacing,
                            std::vector<std::uint32_t>& order) {
  order.resize(samples.size());
  std::iota(order.begin(), order.end(), 0U);
  ShellStorage storage;
  if (samples.empty()) return storage;
  sortIntoRuns(samples, order);
  ShellLevel level = appendLevel(storage, samples, order);
  level.spacing = static_cast<float>(spacing);
  storage.levels.push_back(level);
  return storage;
}

}  // namespace tenon::structures
