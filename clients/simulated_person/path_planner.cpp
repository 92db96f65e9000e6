#include "clients/simulated_person/path_planner.h"

#include <algorithm>
#include <utility>

namespace tenon::simulated_person {

namespace {
// Goals nearer than this are reached on a straight line even inside a box: both ends are in one opening.
constexpr double kStraightDistance = 0.05;  // [m]
// Ends that lie above each other within this horizontal distance are connected by a vertical line.
constexpr double kSameColumn = 0.02;  // [m]
// Boxes that are reached into from above are open at the top: the path rises at most this far above its ends.
constexpr double kLift = 0.15;  // [m]
}  // namespace

void PathPlanner::begin(std::span<const SceneObject> objects) {
  obstacles_.clear();
  for (const SceneObject& object : objects) {
    if (object.kind != "scene") continue;
    const Vector3 half = 0.5 * object.X_WO.matrix().cwiseAbs() * object.size;
    const Vector3 centre = object.X_WO * object.centre;
    obstacles_.push_back({centre - half, centre + half});
  }
}

bool PathPlanner::intersects(const Obstacle& box, const Vector3& from, const Vector3& to,
                             double margin) noexcept {
  double enter = 0.0;
  double leave = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = box.low[axis] - margin;
    const double high = box.high[axis] + margin;
    const double length = to[axis] - from[axis];
    if (length == 0.0) {
      if (from[axis] < low || from[axis] > high) return false;
      continue;
    }
    double a = (low - from[axis]) / length;
    double b = (high - from[axis]) / length;
    if (a > b) std::swap(a, b);
    enter = std::max(enter, a);
    leave = std::min(leave, b);
  }
  return enter < leave;
}

Waypoints PathPlanner::plan(const Vector3& from, const Vector3& to, double margin) const noexcept {
  Waypoints path;
  double top = 0.0;
  bool blocked = false;
  for (const Obstacle& box : obstacles_) {
    if (!intersects(box, from, to, margin)) continue;
    top = blocked ? std::max(top, box.high.z()) : box.high.z();
    blocked = true;
  }
  if (blocked && (to - from).norm() > kStraightDistance && (to - from).head<2>().norm() > kSameColumn) {
    const double higher = std::max(from.z(), to.z());
    const double z = std::max(higher, std::min(top + margin, higher + kLift));
    path.push_back({from.x(), from.y(), z});
    path.push_back({to.x(), to.y(), z});
  }
  path.push_back(to);
  return path;
}

}  // namespace tenon::simulated_person
