#include "server/structures/level_areas.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "server/structures/point_grid.h"

namespace tenon::structures {
namespace {

/// Number of points of levels 0..k, which are stored in order of level.
std::size_t endOf(const ShellLevel& level) { return std::size_t{level.first_point} + level.point_count; }

/// Adds the area of each point from `coarse` on to the nearest of the first `coarse` points.
void addToNearest(std::span<const ShellPoint> points, std::size_t coarse, double cell,
                  std::vector<double>& areas) {
  const double total = std::accumulate(areas.begin(), areas.end(), 0.0);
  PointGrid grid(cell);
  for (std::size_t i = 0; i < coarse; ++i) {
    grid.add(points[i].p_MP.cast<double>(), static_cast<std::uint32_t>(i));
  }
  double assigned = std::accumulate(areas.begin(), areas.begin() + static_cast<std::ptrdiff_t>(coarse), 0.0);
  for (std::size_t i = coarse; i < areas.size(); ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t owner = coarse;
    grid.visitNear(points[i].p_MP.cast<double>(), [&](std::uint32_t other, double squared) {
      if (squared < nearest && points[other].inward_M.dot(points[i].inward_M) >= 0.0F) {
        nearest = squared;
        owner = other;
      }
      return true;
    });
    if (owner == coarse) continue;
    areas[owner] += areas[i];
    assigned += areas[i];
  }
  areas.resize(coarse);
  // the area of points without a near used point is distributed over all
  if (!(assigned > 0.0)) return;
  for (double& area : areas) area *= total / assigned;
}

}  // namespace

std::vector<std::vector<float>> levelAreas(std::span<const ShellPoint> points,
                                           std::span<const ShellLevel> levels) {
  std::vector<std::vector<float>> result(levels.size());
  double furthest = 0.0;  // [m] of any coordinate from 0
  for (const ShellPoint& point : points)
    furthest = std::max<double>(furthest, point.p_MP.cwiseAbs().maxCoeff());
  std::vector<double> areas(points.size());
  std::transform(points.begin(), points.end(), areas.begin(), [](const ShellPoint& p) { return p.area; });
  for (std::size_t k = levels.size(); k-- > 0;) {
    const std::size_t end = std::min(endOf(levels[k]), areas.size());
    // bounded below so that cell coordinates fit into an int
    constexpr double kMinCell = 1e-6;
    const double cell = std::max<double>(levels[k].spacing, kMinCell * furthest);
    if (end < areas.size() && cell > 0.0) addToNearest(points, end, cell, areas);
    areas.resize(end);
    result[k].assign(areas.begin(), areas.end());
  }
  return result;
}

}  // namespace tenon::structures
