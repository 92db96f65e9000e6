#include "clients/haptic/clear_way.h"

#include <algorithm>
#include <utility>

namespace tenon {

namespace {
// Nearer than this one goes straight, whatever an outline says: it is the same opening.
constexpr double kNear = 0.05;        // [m]
constexpr double kSameColumn = 0.02;  // [m]
// What is reached into from above is open there: over its edges, which are no higher than where she works.
constexpr double kLift = 0.15;  // [m]
}  // namespace

void ClearWay::begin(std::span<const SceneObject> objects) {
  boxes_.clear();
  for (const SceneObject& object : objects) {
    if (object.kind != "scene") continue;
    const Vector3 half = 0.5 * object.X_WO.matrix().cwiseAbs() * object.size;
    const Vector3 centre = object.X_WO * object.centre;
    boxes_.push_back({centre - half, centre + half});
  }
}

bool ClearWay::crosses(const Box& box, const Vector3& from, const Vector3& to, double margin) noexcept {
  double enter = 0.0;
  double leave = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = box.low[axis] - margin;
    const double high = box.high[axis] + margin;
    const double way = to[axis] - from[axis];
    if (way == 0.0) {
      if (from[axis] < low || from[axis] > high) return false;
      continue;
    }
    double a = (low - from[axis]) / way;
    double b = (high - from[axis]) / way;
    if (a > b) std::swap(a, b);
    enter = std::max(enter, a);
    leave = std::min(leave, b);
  }
  return enter < leave;
}

Waypoints ClearWay::plan(const Vector3& from, const Vector3& to, double margin) const noexcept {
  Waypoints way;
  double top = 0.0;
  bool blocked = false;
  for (const Box& box : boxes_) {
    if (!crosses(box, from, to, margin)) continue;
    top = blocked ? std::max(top, box.high.z()) : box.high.z();
    blocked = true;
  }
  if (blocked && (to - from).norm() > kNear && (to - from).head<2>().norm() > kSameColumn) {
    const double higher = std::max(from.z(), to.z());
    const double z = std::max(higher, std::min(top + margin, higher + kLift));
    way.push_back({from.x(), from.y(), z});
    way.push_back({to.x(), to.y(), z});
  }
  way.push_back(to);
  return way;
}

}  // namespace tenon
