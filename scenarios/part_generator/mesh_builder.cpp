#include "scenarios/part_generator/mesh_builder.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tenon::part_generator {
namespace {

/// Replaces the corners of a polyline by arcs of radius `bend`, or less where the segments are too short,
/// with `steps` segments for 90 degrees.
std::vector<Vector3> roundCorners(std::span<const Vector3> path, double bend, int steps) {
  std::vector<Vector3> out{path.front()};
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    const Vector3 in = (path[i] - path[i - 1]).normalized();
    const Vector3 on = (path[i + 1] - path[i]).normalized();
    const Vector3 axis = in.cross(on);
    const double sine = axis.norm();
    if (sine < 1e-6) continue;
    const double angle = angleOf(sine, in.dot(on));
    const double room = 0.49 * std::min((path[i] - path[i - 1]).norm(), (path[i + 1] - path[i]).norm());
    const double half_tangent = sine / (1.0 + in.dot(on));
    const double radius = std::min(bend, room / half_tangent);
    const Vector3 start = path[i] - in * radius * half_tangent;
    const Vector3 centre = start + (axis / sine).cross(in) * radius;
    const int count = std::max(2, static_cast<int>(std::lround(steps * angle / (0.5 * kPi))));
    for (int k = 0; k <= count; ++k) {
      out.push_back(centre + expRotation(axis / sine * (angle * k / count)) * (start - centre));
    }
  }
  out.push_back(path.back());
  return out;
}

/// Divides the segments of a polyline into pieces of about `spacing`.
std::vector<Vector3> resample(const std::vector<Vector3>& path, double spacing) {
  std::vector<Vector3> out;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const double length = (path[i + 1] - path[i]).norm();
    const int pieces = std::max(1, static_cast<int>(std::lround(length / spacing)));
    for (int k = 0; k < pieces; ++k) out.push_back(path[i] + (path[i + 1] - path[i]) * k / pieces);
  }
  out.push_back(path.back());
  return out;
}

/// Frames along a path with z along its tangent, transported without rotation about it (parallel transport).
std::vector<Quaternion> transportedFrames(const std::vector<Vector3>& path) {
  std::vector<Quaternion> frames;
  Quaternion q = zTo((path[1] - path[0]).normalized());
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vector3 tangent = (path[std::min(i + 1, path.size() - 1)] - path[i == 0 ? 0 : i - 1]).normalized();
    const Vector3 before = q * Vector3::UnitZ();
    q = (Quaternion::FromTwoVectors(before, tangent) * q).normalized();
    frames.push_back(q);
  }
  return frames;
}

}  // namespace

Quaternion zTo(const Vector3& axis) {
  if (axis.z() < -0.999999) return {0.0, 1.0, 0.0, 0.0};
  return Quaternion::FromTwoVectors(Vector3::UnitZ(), axis);
}

int MeshBuilder::segments(double radius) const {
  const double size = std::clamp(std::sqrt(radius / 0.03), 0.5, 1.7);
  return std::max(8, 4 * static_cast<int>(std::lround((8.0 + 84.0 * detail_) * size / 4.0)));
}

int MeshBuilder::steps(int coarse, int fine) const {
  return coarse + static_cast<int>(std::lround((fine - coarse) * detail_));
}

void MeshBuilder::beginShell(bool closed) { mesh_.shells.push_back({mesh_.triangles.size(), 0, closed}); }

void MeshBuilder::endShell() {
  mesh_.shells.back().count = mesh_.triangles.size() - mesh_.shells.back().first;
}

void MeshBuilder::triangle(const Vector3& a, const Vector3& b, const Vector3& c) {
  if (a == b || b == c || c == a) return;
  mesh_.triangles.push_back({X_MF_ * a, X_MF_ * b, X_MF_ * c});
  mesh_.paint.push_back(color_);
}

void MeshBuilder::quad(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  triangle(a, b, c);
  triangle(a, c, d);
}

void MeshBuilder::connect(const Ring& lower, const Ring& upper) {
  const std::size_t n = lower.size();
  for (std::size_t i = 0; i < n; ++i) quad(lower[i], lower[(i + 1) % n], upper[(i + 1) % n], upper[i]);
}

void MeshBuilder::fan(const Ring& ring, bool up) {
  Vector3 centre = Vector3::Zero();
  for (const Vector3& p : ring) centre += p;
  centre /= static_cast<double>(ring.size());
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vector3& a = ring[i];
    const Vector3& b = ring[(i + 1) % ring.size()];
    up ? triangle(centre, a, b) : triangle(centre, b, a);
  }
}

void MeshBuilder::sweep(std::span<const Ring> rings, bool capped, bool loop) {
  beginShell(capped || loop);
  for (std::size_t i = 0; i + 1 < rings.size(); ++i) connect(rings[i], rings[i + 1]);
  if (loop) connect(rings.back(), rings.front());
  if (capped) {
    fan(rings.front(), false);
    fan(rings.back(), true);
  }
  endShell();
}

void MeshBuilder::box(const Vector3& low, const Vector3& high) { chamferedTongue(low, high, 0.0); }

void MeshBuilder::chamferedTongue(const Vector3& low, const Vector3& high, double chamfer) {
  assert((low.array() < high.array()).all());
  const auto ring = [&](double inset, double z) {
    return Ring{{low.x() + inset, low.y() + inset, z},
                {high.x() - inset, low.y() + inset, z},
                {high.x() - inset, high.y() - inset, z},
                {low.x() + inset, high.y() - inset, z}};
  };
  const Ring foot = ring(chamfer, low.z());
  const Ring top = ring(0.0, high.z());
  beginShell(true);
  if (chamfer > 0.0) {
    const Ring shoulder = ring(0.0, low.z() + chamfer);
    connect(foot, shoulder);
    connect(shoulder, top);
  } else {
    connect(foot, top);
  }
  quad(foot[3], foot[2], foot[1], foot[0]);
  quad(top[0], top[1], top[2], top[3]);
  endShell();
}

void MeshBuilder::roundBox(const Vector3& low, const Vector3& high, double radius) {
  const int n = steps(2, 6);
  const Vector3 centre = 0.5 * (low + high);
  const Vector3 half = 0.5 * (high - low);
  const double r = std::min(radius, 0.999 * half.minCoeff());
  const Vector3 core = half - Vector3::Constant(r);
  // coordinates along one axis: the roundings are divided at equal angles
  const auto coordinates = [&](int axis) {
    std::vector<double> c;
    for (int k = n; k >= 0; --k) {
      const Vector2 d = direction(0.25 * kPi * k / n);
      c.push_back(-core[axis] - r * d.y() / d.x());
    }
    for (int k = 0; k <= n; ++k) {
      const Vector2 d = direction(0.25 * kPi * k / n);
      c.push_back(core[axis] + r * d.y() / d.x());
    }
    return c;
  };
  beginShell(true);
  for (int axis = 0; axis < 3; ++axis) {
    const int iu = (axis + 1) % 3;
    const int iv = (axis + 2) % 3;
    const std::vector<double> us = coordinates(iu);
    const std::vector<double> vs = coordinates(iv);
    for (const double side : {-1.0, 1.0}) {
      const auto point = [&](std::size_t i, std::size_t j) -> Vector3 {
        Vector3 p;
        p[axis] = side * half[axis];
        p[iu] = us[i];
        p[iv] = vs[j];
        const Vector3 inner = p.cwiseMax(-core).cwiseMin(core);
        return centre + inner + r * (p - inner).normalized();
      };
      for (std::size_t i = 0; i + 1 < us.size(); ++i) {
        for (std::size_t j = 0; j + 1 < vs.size(); ++j) {
          if (side > 0.0) {
            quad(point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
          } else {
            quad(point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j));
          }
        }
      }
    }
  }
  endShell();
}

void MeshBuilder::lathe(const Vector3& foot, const Vector3& axis, std::span<const Vector2> profile,
                        bool closed) {
  double largest_radius = 0.0;
  for (const Vector2& p : profile) largest_radius = std::max(largest_radius, p.x());
  const int n = segments(largest_radius);
  const Quaternion q = zTo(axis.normalized());
  std::vector<Vector2> around;
  for (int i = 0; i < n; ++i) around.push_back(direction(2.0 * kPi * i / n));
  std::vector<Ring> rings;
  for (const Vector2& p : profile) {
    Ring ring;
    for (const Vector2& d : around)
      ring.emplace_back(foot + q * Vector3(p.x() * d.x(), p.x() * d.y(), p.y()));
    rings.push_back(std::move(ring));
  }
  beginShell(closed);
  for (std::size_t i = 0; i + 1 < rings.size(); ++i) connect(rings[i], rings[i + 1]);
  if (closed && profile.front() == profile.back()) {
    // a profile that ends where it begins has no ends to cap
  } else if (closed) {
    if (profile.front().x() > 0.0) fan(rings.front(), false);
    if (profile.back().x() > 0.0) fan(rings.back(), true);
  }
  endShell();
}

void MeshBuilder::cylinder(const Vector3& from, const Vector3& to, double radius, double chamfer) {
  const double length = (to - from).norm();
  if (chamfer <= 0.0) {
    const std::array<Vector2, 2> profile{Vector2(radius, 0.0), Vector2(radius, length)};
    lathe(from, to - from, profile);
    return;
  }
  const std::array<Vector2, 4> profile{Vector2(radius - chamfer, 0.0), Vector2(radius, chamfer),
                                       Vector2(radius, length - chamfer), Vector2(radius - chamfer, length)};
  lathe(from, to - from, profile);
}

void MeshBuilder::cone(const Vector3& from, const Vector3& to, double radius_from, double radius_to) {
  const std::array<Vector2, 2> profile{Vector2(radius_from, 0.0), Vector2(radius_to, (to - from).norm())};
  lathe(from, to - from, profile);
}

void MeshBuilder::tube(const Vector3& from, const Vector3& to, double outer, double inner) {
  const double length = (to - from).norm();
  const std::array<Vector2, 5> profile{Vector2(outer, 0.0), Vector2(outer, length), Vector2(inner, length),
                                       Vector2(inner, 0.0), Vector2(outer, 0.0)};
  lathe(from, to - from, profile);
}

void MeshBuilder::sphere(const Vector3& centre, double radius) {
  const int n = segments(radius) / 2;
  std::vector<Vector2> profile;
  for (int i = 0; i <= n; ++i) {
    const Vector2 d = direction(kPi * (static_cast<double>(i) / n - 0.5));
    profile.emplace_back(i == 0 || i == n ? 0.0 : radius * d.x(), radius * (1.0 + d.y()));
  }
  lathe(centre - Vector3(0.0, 0.0, radius), Vector3::UnitZ(), profile);
}

void MeshBuilder::torus(const Vector3& centre, const Vector3& axis, double ring, double radius) {
  std::vector<Vector2> profile;
  const int n = segments(radius);
  for (int i = 0; i <= n; ++i) {
    const Vector2 d = direction(2.0 * kPi * (i % n) / n);
    profile.emplace_back(ring + radius * d.x(), radius * d.y());
  }
  lathe(centre, axis, profile);
}

void MeshBuilder::pipe(std::span<const Vector3> path, double radius, double bend) {
  const std::vector<Vector3> line = roundCorners(path, bend, steps(3, 24));
  const std::vector<Quaternion> frames = transportedFrames(line);
  const Polygon section = circle(Vector2::Zero(), radius, segments(radius));
  std::vector<Ring> rings;
  for (std::size_t i = 0; i < line.size(); ++i) {
    Ring ring;
    for (const Vector2& c : section) ring.emplace_back(line[i] + frames[i] * Vector3(c.x(), c.y(), 0.0));
    rings.push_back(std::move(ring));
  }
  sweep(rings, true, false);
}

void MeshBuilder::hose(std::span<const Vector3> path, double radius, double bend, double pitch, double rib) {
  const std::vector<Vector3> line = resample(roundCorners(path, bend, steps(4, 24)), 0.25 * pitch);
  const std::vector<Quaternion> frames = transportedFrames(line);
  std::vector<Ring> rings;
  for (std::size_t i = 0; i < line.size(); ++i) {
    Ring ring;
    const double r = i % 4 < 2 ? radius : radius - rib;
    for (const Vector2& c : circle(Vector2::Zero(), r, segments(radius))) {
      ring.emplace_back(line[i] + frames[i] * Vector3(c.x(), c.y(), 0.0));
    }
    rings.push_back(std::move(ring));
  }
  sweep(rings, true, false);
}

void MeshBuilder::spring(const Vector3& foot, double height, double coil_radius, double wire_radius,
                         int turns) {
  std::vector<Vector3> path;
  const int count = turns * steps(14, 56);
  for (int i = 0; i <= count; ++i) {
    const double fraction = static_cast<double>(i) / count;
    const Vector2 d = direction(2.0 * kPi * (turns * fraction - std::floor(turns * fraction)));
    path.emplace_back(foot + Vector3(coil_radius * d.x(), coil_radius * d.y(), height * fraction));
  }
  pipe(path, wire_radius, 0.0);
}

void MeshBuilder::prism(const Polygon& given, std::span<const Polygon> holes, double z_low, double z_high) {
  Polygon outline(given);
  if (signedArea(outline) < 0.0) std::reverse(outline.begin(), outline.end());
  const auto triangles = triangulate(outline, holes);
  std::vector<Vector2> points(outline);
  for (const Polygon& hole : holes) points.insert(points.end(), hole.begin(), hole.end());
  const auto lift = [&](int i, double z) { return Vector3(points[i].x(), points[i].y(), z); };
  beginShell(true);
  for (const auto& t : triangles) {
    triangle(lift(t[0], z_high), lift(t[1], z_high), lift(t[2], z_high));
    triangle(lift(t[2], z_low), lift(t[1], z_low), lift(t[0], z_low));
  }
  const auto wall = [&](const Polygon& loop, bool outer) {
    for (std::size_t i = 0; i < loop.size(); ++i) {
      Vector2 a = loop[i];
      Vector2 b = loop[(i + 1) % loop.size()];
      if (!outer) std::swap(a, b);
      quad({a.x(), a.y(), z_low}, {b.x(), b.y(), z_low}, {b.x(), b.y(), z_high}, {a.x(), a.y(), z_high});
    }
  };
  wall(outline, true);
  for (const Polygon& hole : holes) wall(hole, false);
  endShell();
}

}  // namespace tenon::part_generator
