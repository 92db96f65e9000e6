#pragma once

#include <filesystem>
#include <optional>
#include <span>

#include "scenarios/part_generator/mesh.h"

namespace tenon::part_generator {

struct PictureObject {
  const PartMesh* mesh = nullptr;
  Pose X_WO;
  std::optional<Color> color;  ///< instead of the mesh's own colours
  double opacity = 1.0;        ///< [-] below 1 it is blended over everything behind it
};

struct PictureCamera {
  Vector3 p_WE = Vector3(2.0, -3.0, 2.5);  ///< position
  Vector3 p_WT = Vector3(0.0, 0.8, 0.6);   ///< the point it is aimed at; z_W is up in the picture
  double half_angle_tangent = 0.42;        ///< [-] tangent of half the vertical field of view
  int width = 1600;                        ///< [pixels]
  int height = 1000;                       ///< [pixels]
};

/// Renders objects that stand on the ground z = 0 into a PNG: sun with soft shadow, sky, ambient occlusion,
/// thin outlines, four samples per pixel. For documentation and reports: it takes seconds. Fails when the
/// file cannot be written.
[[nodiscard]] Result<void> renderScene(std::span<const PictureObject> objects, const PictureCamera& camera,
                                       const std::filesystem::path& file);

}  // namespace tenon::part_generator
