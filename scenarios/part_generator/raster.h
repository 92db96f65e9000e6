#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "idl/types/spatial.h"
#include "scenarios/part_generator/mesh.h"

namespace tenon::part_generator {

/// Unit normals for smooth shading, per corner of each triangle: averaged over the faces of its shell that
/// meet in the same point at less than about 40 degrees.
[[nodiscard]] std::vector<std::array<Vector3f, 3>> smoothNormals(const PartMesh& mesh);

/// Depth buffer: the surface nearest to the eye in each sample of a picture.
struct SampleBuffer {
  SampleBuffer(int width_, int height_)
      : width(width_),
        height(height_),
        depth(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kFar),
        normal(depth.size(), Vector3f::Zero()),
        color(depth.size(), 0) {}

  static constexpr float kFar = 1e30F;  ///< [m] depth of samples without a surface
  int width;                            ///< [samples]
  int height;                           ///< [samples]
  std::vector<float> depth;             ///< [m] along the view axis
  std::vector<Vector3f> normal;
  std::vector<Color> color;

  /// Index of a sample.
  [[nodiscard]] std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

/// Projection of points of the world into a picture; orthographic when `focal` is 0.
struct Projection {
  Matrix3 R_EW = Matrix3::Identity();  ///< eye frame E: x right, y down, z forward
  Vector3 p_WE = Vector3::Zero();
  double focal = 0.0;     ///< [samples] at distance 1
  double scale = 1.0;     ///< [samples/m] when orthographic
  double centre_x = 0.0;  ///< [samples] image of the eye axis
  double centre_y = 0.0;  ///< [samples]

  /// (x, y) in samples, z the depth [m].
  [[nodiscard]] Vector3 project(const Vector3& p_W) const {
    const Vector3 p_E = R_EW * (p_W - p_WE);
    const double k = focal > 0.0 ? focal / p_E.z() : scale;
    return {centre_x + k * p_E.x(), centre_y + k * p_E.y(), p_E.z()};
  }
  /// The point of the world at sample `x` [samples], `y` [samples] and `depth` [m].
  [[nodiscard]] Vector3 unproject(double x, double y, double depth) const {
    const double k = focal > 0.0 ? depth / focal : 1.0 / scale;
    return p_WE + R_EW.transpose() * Vector3((x - centre_x) * k, (y - centre_y) * k, depth);
  }
};

/// R_EW of an eye that looks along `ahead`, which is not vertical, with the world's z up.
[[nodiscard]] Matrix3 lookAlong(const Vector3& ahead);

/// Draws one triangle with interpolated corner normals where it is nearer than the buffer. A triangle with a
/// corner nearer than 50 mm to the eye is skipped.
void drawTriangle(SampleBuffer& buffer, const Projection& projection, const std::array<Vector3, 3>& corners_W,
                  const std::array<Vector3f, 3>& normals_W, Color color);

}  // namespace tenon::part_generator
