#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include "scenarios/mesh.h"

namespace tenon {

struct PictureObject {
  const PartMesh* mesh = nullptr;
  Pose X_WO;
  std::optional<Color> color;  ///< instead of the mesh's own paint
  double opacity = 1.0;        ///< below 1 it is drawn as a ghost, over everything behind it
};

struct Camera {
  Vector3 p_WE = Vector3(2.0, -3.0, 2.5);  ///< the eye
  Vector3 p_WT = Vector3(0.0, 0.8, 0.6);   ///< what it looks at; z is up in the picture
  double half_angle_tangent = 0.42;        ///< of half the picture's height
  int width = 1600;
  int height = 1000;
};

/// Draws objects that stand on the ground z = 0 into a PNG: sun with soft shadow, sky, darkening in corners,
/// thin outlines, four samples a pixel. For documentation and reports; it takes seconds, not frames.
[[nodiscard]] Result<void> renderScene(std::span<const PictureObject> objects, const Camera& camera,
                                       const std::filesystem::path& file);

}  // namespace tenon
