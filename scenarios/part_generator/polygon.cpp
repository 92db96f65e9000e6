#include <algorithm>
#include <numeric>

#include "scenarios/part_generator/mesh_builder.h"

namespace tenon::part_generator {
namespace {

double cross(const Vector2& a, const Vector2& b, const Vector2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

bool insideTriangle(const Vector2& p, const Vector2& a, const Vector2& b, const Vector2& c) {
  return cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0;
}

bool segmentsCross(const Vector2& a, const Vector2& b, const Vector2& c, const Vector2& d) {
  return cross(a, b, c) * cross(a, b, d) < 0.0 && cross(c, d, a) * cross(c, d, b) < 0.0;
}

/// Joins a hole to the loop by a bridge edge used in both directions, so that one loop remains.
void bridgeHole(std::vector<int>& loop, const std::vector<int>& hole, const std::vector<Vector2>& points) {
  const auto right =
      static_cast<std::size_t>(std::max_element(hole.begin(), hole.end(),
                                                [&](int a, int b) { return points[a].x() < points[b].x(); }) -
                               hole.begin());
  const Vector2 from = points[hole[right]];
  // the nearest corner of the loop that the bridge reaches without crossing an edge
  std::size_t best = 0;
  double best_distance = 1e300;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Vector2 to = points[loop[i]];
    const double distance = (to - from).squaredNorm();
    if (distance >= best_distance) continue;
    const Vector2 before = points[loop[(i + loop.size() - 1) % loop.size()]];
    const Vector2 after = points[loop[(i + 1) % loop.size()]];
    const bool convex = cross(before, to, after) >= 0.0;
    const bool left_of_in = cross(before, to, from) > 0.0;
    const bool left_of_out = cross(to, after, from) > 0.0;
    if (convex ? !(left_of_in && left_of_out) : !(left_of_in || left_of_out)) continue;
    bool clear = true;
    for (std::size_t k = 0; k < loop.size() && clear; ++k) {
      clear = !segmentsCross(from, to, points[loop[k]], points[loop[(k + 1) % loop.size()]]);
    }
    for (std::size_t k = 0; k < hole.size() && clear; ++k) {
      clear = !segmentsCross(from, to, points[hole[k]], points[hole[(k + 1) % hole.size()]]);
    }
    if (!clear) continue;
    best = i;
    best_distance = distance;
  }
  std::vector<int> cut;
  for (std::size_t k = 0; k <= hole.size(); ++k) cut.push_back(hole[(right + k) % hole.size()]);
  cut.push_back(loop[best]);
  loop.insert(loop.begin() + static_cast<std::ptrdiff_t>(best) + 1, cut.begin(), cut.end());
}

bool isEar(const std::vector<int>& loop, std::size_t i, const std::vector<Vector2>& points) {
  const std::size_t n = loop.size();
  const Vector2 a = points[loop[(i + n - 1) % n]];
  const Vector2 b = points[loop[i]];
  const Vector2 c = points[loop[(i + 1) % n]];
  if (cross(a, b, c) <= 0.0) return false;
  for (const int other : loop) {
    const Vector2& p = points[other];
    if (p == a || p == b || p == c) continue;
    if (insideTriangle(p, a, b, c)) return false;
  }
  return true;
}

}  // namespace

Vector2 direction(double angle) {
  while (angle > kPi) angle -= 2.0 * kPi;
  while (angle < -kPi) angle += 2.0 * kPi;
  const Vector3 v = expRotation(Vector3(0.0, 0.0, angle)) * Vector3::UnitX();
  return {v.x(), v.y()};
}

double signedArea(const Polygon& outline) {
  double sum = 0.0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector2& a = outline[i];
    const Vector2& b = outline[(i + 1) % outline.size()];
    sum += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  return sum;
}

Polygon circle(const Vector2& centre, double radius, int segments) {
  Polygon polygon;
  for (int i = 0; i < segments; ++i)
    polygon.emplace_back(centre + radius * direction(2.0 * kPi * i / segments));
  return polygon;
}

Polygon roundedRectangle(const Vector2& centre, const Vector2& size, double radius, int corner_segments) {
  Polygon polygon;
  const Vector2 inner = 0.5 * size - Vector2::Constant(radius);
  for (int corner = 0; corner < 4; ++corner) {
    const Vector2 sign(corner == 0 || corner == 3 ? 1.0 : -1.0, corner < 2 ? 1.0 : -1.0);
    for (int i = 0; i <= corner_segments; ++i) {
      const double angle = 0.5 * kPi * (corner + static_cast<double>(i) / corner_segments);
      polygon.emplace_back(centre + sign.cwiseProduct(inner) + radius * direction(angle));
    }
  }
  return polygon;
}

std::vector<std::array<int, 3>> triangulate(const Polygon& outer, std::span<const Polygon> holes) {
  std::vector<Vector2> points(outer);
  std::vector<int> loop(outer.size());
  std::iota(loop.begin(), loop.end(), 0);
  std::vector<std::vector<int>> rings;
  for (const Polygon& hole : holes) {
    std::vector<int> ring(hole.size());
    std::iota(ring.rbegin(), ring.rend(), static_cast<int>(points.size()));
    points.insert(points.end(), hole.begin(), hole.end());
    rings.push_back(std::move(ring));
  }
  // from right to left, so that a bridge never has to cross a hole that is not joined yet
  std::stable_sort(rings.begin(), rings.end(), [&](const auto& a, const auto& b) {
    const auto right = [&](const std::vector<int>& ring) {
      double x = -1e300;
      for (const int i : ring) x = std::max(x, points[i].x());
      return x;
    };
    return right(a) > right(b);
  });
  for (const auto& ring : rings) bridgeHole(loop, ring, points);

  std::vector<std::array<int, 3>> triangles;
  std::size_t i = 0;
  std::size_t rejected = 0;
  while (loop.size() > 3 && rejected <= loop.size()) {
    const std::size_t n = loop.size();
    i %= n;
    if (isEar(loop, i, points)) {
      triangles.push_back({loop[(i + n - 1) % n], loop[i], loop[(i + 1) % n]});
      loop.erase(loop.begin() + static_cast<std::ptrdiff_t>(i));
      rejected = 0;
    } else {
      ++i;
      ++rejected;
    }
  }
  if (loop.size() == 3) triangles.push_back({loop[0], loop[1], loop[2]});
  return triangles;
}

}  // namespace tenon::part_generator
