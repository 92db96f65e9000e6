#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "idl/types/spatial.h"

namespace tenon::bake {

/// A vertex of a display model: position in units of GlbMesh::step, unit normal times 127.
struct GlbVertex {
  std::array<std::uint16_t, 4> position{};  ///< the fourth is padding
  std::array<std::int8_t, 4> normal{};      ///< the fourth is padding
  std::array<std::uint16_t, 4> color{};     ///< linear red, green, blue and opacity, of 65535
};

/// A mesh in the frame of glTF, quantised.
struct GlbMesh {
  std::vector<GlbVertex> vertices;
  std::vector<std::uint32_t> indices;
  bool has_colors = false;           ///< else GlbVertex::color means nothing
  Vector3 origin = Vector3::Zero();  ///< [m] of position 0
  double step = 1.0;                 ///< [m] of a unit of a position
};

/// The mesh as a binary glTF 2.0 file.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] std::vector<std::uint8_t> writeGlb(const GlbMesh& mesh);

}  // namespace tenon::bake
