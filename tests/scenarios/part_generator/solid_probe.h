#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "scenarios/part_generator/mesh.h"

namespace tenon::test {

using TriangleCorners = std::array<Vector3, 3>;

inline Eigen::AlignedBox3d boxOf(const TriangleCorners& t) {
  Eigen::AlignedBox3d box(t[0]);
  box.extend(t[1]);
  box.extend(t[2]);
  return box;
}

inline TriangleCorners transformed(const Pose& X_WM, const TriangleCorners& t) {
  return {X_WM * t[0], X_WM * t[1], X_WM * t[2]};
}

/// Appends points of a triangle: bisects its longest edge until no edge is longer than `spacing` [m], and
/// skips pieces outside of the region.
inline void sampleTriangle(const TriangleCorners& t, double spacing, const Eigen::AlignedBox3d& region,
                           std::vector<Vector3>& points) {
  if (!boxOf(t).intersects(region)) return;
  std::size_t longest = 0;
  double length = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double edge = (t[(i + 1) % 3] - t[i]).norm();
    if (edge > length) {
      length = edge;
      longest = i;
    }
  }
  if (length <= spacing) {
    points.insert(points.end(), t.begin(), t.end());
    return;
  }
  const Vector3& a = t[longest];
  const Vector3& b = t[(longest + 1) % 3];
  const Vector3& c = t[(longest + 2) % 3];
  const Vector3 middle = 0.5 * (a + b);
  sampleTriangle({a, middle, c}, spacing, region, points);
  sampleTriangle({middle, b, c}, spacing, region, points);
}

/// Points of the surface near `region_W`, in W, at most about `spacing` [m] apart; sorted, without
/// duplicates.
inline std::vector<Vector3> surfacePoints(const part_generator::PartMesh& mesh, const Pose& X_WM,
                                          double spacing, const Eigen::AlignedBox3d& region_W) {
  std::vector<Vector3> points;
  for (const TriangleCorners& t : mesh.triangles)
    sampleTriangle(transformed(X_WM, t), spacing, region_W, points);
  const auto less = [](const Vector3& a, const Vector3& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::sort(points.begin(), points.end(), less);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

/// The first of the points in each cell of a grid of edge `cell` [m].
inline std::vector<Vector3> onePointPerCell(const std::vector<Vector3>& points, double cell) {
  std::map<std::array<long, 3>, Vector3> first_in_cell;
  for (const Vector3& p : points) {
    first_in_cell.try_emplace(
        {std::lround(p.x() / cell), std::lround(p.y() / cell), std::lround(p.z() / cell)}, p);
  }
  std::vector<Vector3> out;
  for (const auto& [key, p] : first_in_cell) out.push_back(p);
  return out;
}

/// [m]
inline double distanceToTriangle(const Vector3& p, const TriangleCorners& t) {
  const Vector3 ab = t[1] - t[0];
  const Vector3 ac = t[2] - t[0];
  const Vector3 normal = ab.cross(ac);
  const auto toEdge = [&](const Vector3& a, const Vector3& b) {
    const Vector3 edge = b - a;
    const double along = std::clamp((p - a).dot(edge) / std::max(edge.squaredNorm(), 1e-300), 0.0, 1.0);
    return (p - a - along * edge).norm();
  };
  const bool projects_inside = (t[1] - t[0]).cross(p - t[0]).dot(normal) >= 0.0 &&
                               (t[2] - t[1]).cross(p - t[1]).dot(normal) >= 0.0 &&
                               (t[0] - t[2]).cross(p - t[2]).dot(normal) >= 0.0;
  if (projects_inside && normal.norm() > 0.0) return std::abs((p - t[0]).dot(normal)) / normal.norm();
  return std::min({toEdge(t[0], t[1]), toEdge(t[1], t[2]), toEdge(t[2], t[0])});
}

/// Queries a mesh within a region of W by brute force: point inside a closed shell by ray parity, distance to
/// the nearest triangle.
class SolidProbe {
 public:
  SolidProbe(const part_generator::PartMesh& mesh, const Pose& X_WM, const Eigen::AlignedBox3d& region_W) {
    for (const part_generator::PartMesh::Shell& shell : mesh.shells) {
      Eigen::AlignedBox3d box;
      part_generator::PartMesh solid;
      for (std::size_t i = shell.first; i < shell.first + shell.count; ++i) {
        const TriangleCorners t = transformed(X_WM, mesh.triangles[i]);
        box.extend(boxOf(t));
        solid.triangles.push_back(t);
        if (boxOf(t).intersects(region_W)) triangles_.push_back(t);
      }
      if (!shell.closed || !box.intersects(region_W)) continue;
      solid.shells.push_back({0, shell.count, true});
      solids_.push_back(std::move(solid));
      solid_boxes_.push_back(box);
    }
    for (const TriangleCorners& t : triangles_) boxes_.push_back(boxOf(t));
  }

  [[nodiscard]] bool inside(const Vector3& p_W) const {
    for (std::size_t i = 0; i < solids_.size(); ++i) {
      if (solid_boxes_[i].contains(p_W) && part_generator::insideAnyShell(solids_[i], p_W)) return true;
    }
    return false;
  }

  /// The distance [m] to the nearest triangle, or `max_distance` [m] when none is nearer.
  [[nodiscard]] double distance(const Vector3& p_W, double max_distance) const {
    double nearest = max_distance;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      if (boxes_[i].squaredExteriorDistance(p_W) >= nearest * nearest) continue;
      nearest = std::min(nearest, distanceToTriangle(p_W, triangles_[i]));
    }
    return nearest;
  }

 private:
  std::vector<part_generator::PartMesh> solids_;
  std::vector<Eigen::AlignedBox3d> solid_boxes_;
  std::vector<TriangleCorners> triangles_;
  std::vector<Eigen::AlignedBox3d> boxes_;
};

}  // namespace tenon::test
