#pragma once

#include <array>

namespace tenon::structures {

/// Empty space of a mesh that is solid in its field: a closed void, or a slot too narrow for the voxels.
struct FilledSpace {
  std::array<float, 3> low{}, high{};  ///< [m] bounding box of its walls, in M
  float wall_area = 0.0F;              ///< [m^2]
};

}  // namespace tenon::structures
