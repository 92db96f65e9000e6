#include "scenarios/part_generator/raster.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tenon::part_generator {
namespace {

constexpr double kNear = 0.05;          ///< [m] near plane
constexpr float kCreaseCosine = 0.76F;  ///< [-] of 40.5 degrees

std::array<std::int64_t, 3> gridPoint(const Vector3& p) {
  constexpr double kGrid = 1e-6;
  return {std::llround(p.x() / kGrid), std::llround(p.y() / kGrid), std::llround(p.z() / kGrid)};
}

}  // namespace

std::vector<std::array<Vector3f, 3>> smoothNormals(const PartMesh& mesh) {
  const std::size_t count = mesh.triangles.size();
  std::vector<Vector3f> area_normals(count);
  std::vector<std::array<Vector3f, 3>> normals(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& t = mesh.triangles[i];
    area_normals[i] = (t[1] - t[0]).cross(t[2] - t[0]).cast<float>();
  }
  for (const PartMesh::Shell& shell : mesh.shells) {
    std::vector<std::pair<std::array<std::int64_t, 3>, std::size_t>> corners;
    corners.reserve(3 * shell.count);
    for (std::size_t i = 3 * shell.first; i < 3 * (shell.first + shell.count); ++i) {
      corners.emplace_back(gridPoint(mesh.triangles[i / 3][i % 3]), i);
    }
    std::sort(corners.begin(), corners.end());
    for (std::size_t first = 0; first < corners.size();) {
      std::size_t end = first;
      while (end < corners.size() && corners[end].first == corners[first].first) ++end;
      for (std::size_t k = first; k < end; ++k) {
        const Vector3f face_normal = area_normals[corners[k].second / 3].normalized();
        Vector3f sum = Vector3f::Zero();
        for (std::size_t other = first; other < end; ++other) {
          const Vector3f& face = area_normals[corners[other].second / 3];
          if (face.dot(face_normal) > kCreaseCosine * face.norm()) sum += face;
        }
        const float length = sum.norm();
        normals[corners[k].second / 3][corners[k].second % 3] =
            length > 0.0F ? Vector3f(sum / length) : face_normal;
      }
      first = end;
    }
  }
  return normals;
}

Matrix3 lookAlong(const Vector3& ahead) {
  const Vector3 z = ahead.normalized();
  const Vector3 x = z.cross(Vector3::UnitZ()).normalized();
  Matrix3 R_EW;
  R_EW.row(0) = x;
  R_EW.row(1) = z.cross(x);
  R_EW.row(2) = z;
  return R_EW;
}

void drawTriangle(SampleBuffer& buffer, const Projection& projection, const std::array<Vector3, 3>& corners_W,
                  const std::array<Vector3f, 3>& normals_W, Color color) {
  std::array<Vector3, 3> p;
  for (std::size_t i = 0; i < 3; ++i) {
    p[i] = projection.project(corners_W[i]);
    if (p[i].z() < kNear) return;
  }
  const double area =
      (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) - (p[1].y() - p[0].y()) * (p[2].x() - p[0].x());
  if (area == 0.0) return;
  const auto [x_low, x_high] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
  const auto [y_low, y_high] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
  const int x0 = std::max(0, static_cast<int>(std::floor(std::max(x_low, -1.0))));
  const int x1 = std::min(buffer.width - 1, static_cast<int>(std::min(x_high, 1e6)));
  const int y0 = std::max(0, static_cast<int>(std::floor(std::max(y_low, -1.0))));
  const int y1 = std::min(buffer.height - 1, static_cast<int>(std::min(y_high, 1e6)));
  const bool perspective = projection.focal > 0.0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double sx = x + 0.5;
      const double sy = y + 0.5;
      std::array<double, 3> w;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3& a = p[(i + 1) % 3];
        const Vector3& b = p[(i + 2) % 3];
        w[i] = ((b.x() - a.x()) * (sy - a.y()) - (b.y() - a.y()) * (sx - a.x())) / area;
      }
      if (w[0] < 0.0 || w[1] < 0.0 || w[2] < 0.0) continue;
      if (perspective) {
        for (std::size_t i = 0; i < 3; ++i) w[i] /= p[i].z();
      }
      const double sum = w[0] + w[1] + w[2];
      const auto depth = static_cast<float>((w[0] * p[0].z() + w[1] * p[1].z() + w[2] * p[2].z()) / sum);
      const std::size_t index = buffer.at(x, y);
      if (depth >= buffer.depth[index]) continue;
      buffer.depth[index] = depth;
      buffer.color[index] = color;
      buffer.normal[index] =
          (static_cast<float>(w[0]) * normals_W[0] + static_cast<float>(w[1]) * normals_W[1] +
           static_cast<float>(w[2]) * normals_W[2])
              .normalized();
    }
  }
}

}  // namespace tenon::part_generator
