#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "idl/types/spatial.h"
#include "scenarios/mesh.h"

namespace tenon {

/// Per corner of a mesh the normal a smooth surface would have there: averaged over the faces that meet in
/// the same point at less than about 40 degrees.
[[nodiscard]] std::vector<std::array<Vector3f, 3>> smoothNormals(const PartMesh& mesh);

/// What is nearest to the eye in each sample of a picture.
struct SampleBuffer {
  SampleBuffer(int width_, int height_)
      : width(width_),
        height(height_),
        depth(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kFar),
        normal(depth.size(), Vector3f::Zero()),
        color(depth.size(), 0) {}

  static constexpr float kFar = 1e30F;
  int width;
  int height;
  std::vector<float> depth;  ///< [m] along the view axis
  std::vector<Vector3f> normal;
  std::vector<Color> color;

  [[nodiscard]] std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

/// How points of the world get into a picture; orthographic when `focal` is 0.
struct Projection {
  Matrix3 R_EW = Matrix3::Identity();  ///< eye frame: x right, y down, z ahead
  Vector3 p_WE = Vector3::Zero();
  double focal = 0.0;  ///< [samples] at distance 1
  double scale = 1.0;  ///< [samples/m] when orthographic
  double centre_x = 0.0;
  double centre_y = 0.0;

  /// (x, y) in samples, z the depth [m].
  [[nodiscard]] Vector3 project(const Vector3& p_W) const {
    const Vector3 p_E = R_EW * (p_W - p_WE);
    const double k = focal > 0.0 ? focal / p_E.z() : scale;
    return {centre_x + k * p_E.x(), centre_y + k * p_E.y(), p_E.z()};
  }
  /// The point of the world at a sample and depth.
  [[nodiscard]] Vector3 unproject(double x, double y, double depth) const {
    const double k = focal > 0.0 ? depth / focal : 1.0 / scale;
    return p_WE + R_EW.transpose() * Vector3((x - centre_x) * k, (y - centre_y) * k, depth);
  }
};

/// The eye frame that looks along `ahead` with the world's z up.
[[nodiscard]] Matrix3 lookAlong(const Vector3& ahead);

/// Draws one triangle with its corner normals; samples nearer than what is there win.
void drawTriangle(SampleBuffer& buffer, const Projection& projection, const std::array<Vector3, 3>& corners_W,
                  const std::array<Vector3f, 3>& normals_W, Color color);

}  // namespace tenon
