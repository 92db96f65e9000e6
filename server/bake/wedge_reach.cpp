#include "server/bake/wedge_reach.h"

#include <algorithm>
#include <cmath>

#include "idl/types/fixed_vector.h"

namespace tenon::bake {
namespace {

constexpr double kMinSine = 0.1;        // [-] of the angle between the faces
constexpr double kBetweenEnds = 0.999;  // [-] of a piece: faces at its ends begin there

/// A triangle cut by two planes has five corners at most.
using Outline = FixedVector<Vector3, 6>;

/// What of a outline is on the side of a plane where `along` . v <= `limit` [m].
Outline cut(const Outline& outline, const Vector3& along, double limit) {
  Outline kept;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector3& a = outline[i];
    const Vector3& b = outline[(i + 1) % outline.size()];
    const double beyond_a = along.dot(a) - limit;
    const double beyond_b = along.dot(b) - limit;
    if (beyond_a <= 0.0) kept.push_back(a);
    if ((beyond_a < 0.0 && beyond_b > 0.0) || (beyond_a > 0.0 && beyond_b < 0.0))
      kept.push_back(a + (b - a) * (beyond_a / (beyond_a - beyond_b)));
  }
  return kept;
}

/// [m] Distance of a convex outline from the line through the origin along the unit vector `along`.
double distanceFromLine(const Outline& outline, const Vector3& along) {
  const auto flat = [&along](const Vector3& v) { return Vector3(v - along * along.dot(v)); };
  double nearest = std::numeric_limits<double>::infinity();
  bool left = false;
  bool right = false;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector3 a = flat(outline[i]);
    const Vector3 ab = flat(outline[(i + 1) % outline.size()]) - a;
    const double squared = ab.squaredNorm();
    const double t = squared > 0.0 ? std::clamp(-a.dot(ab) / squared, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, (a + t * ab).norm());
    const double side = along.dot(ab.cross(-a));
    left = left || side > 0.0;
    right = right || side < 0.0;
  }
  return left != right ? 0.0 : nearest;  // the line is on one side of all its borders: it passes through
}

}  // namespace

double WedgeReach::of(const WedgePiece& piece, double most, double tolerance) const {
  const auto& [centre, half, into, skew] = piece;
  const double cosine = into[0].dot(into[1]);
  const double sine = into[0].cross(into[1]).norm();
  if (sine < kMinSine) return 0.0;
  const std::array<Vector3, 2> normals{(cosine * into[0] - into[1]) / sine,
                                       (cosine * into[1] - into[0]) / sine};
  const double length = half.norm();
  const Vector3 along = half / length;
  double reach = most;
  const double farthest = length + most * std::max(skew[0].norm(), skew[1].norm());
  tree_.visitWithin(centre, std::hypot(farthest, most), [&](const structures::Triangle& triangle) {
    const auto isIn = [&](const Vector3& normal) {
      return std::ranges::all_of(triangle, [&](const Vector3& corner) {
        return std::abs(normal.dot(corner - centre)) <= tolerance;
      });
    };
    if (std::ranges::any_of(normals, isIn)) return false;
    Outline outline;
    for (const Vector3& corner : triangle) outline.push_back(corner - centre);
    outline =
        cut(cut(outline, skew[0] - along, kBetweenEnds * length), skew[1] + along, kBetweenEnds * length);
    if (!outline.empty()) reach = std::min(reach, distanceFromLine(outline, along));
    return false;
  });
  return reach;
}

}  // namespace tenon::bake
