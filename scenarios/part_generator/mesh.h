#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon::part_generator {

/// 0xRRGGBB, sRGB.
using Color = std::uint32_t;
/// Of triangles that have the colour that a scenario gives their object.
inline constexpr Color kUnpainted = 0xFFFFFFFF;

/// Triangles as a CAD system exports them: shells that overlap, share no vertices and need not be closed.
///
/// Each triangle has its own three corners, as in an STL file. `shells` keeps what an STL file does not,
/// which triangles form one solid, so that tests can ask whether a point is inside one.
struct PartMesh {
  /// A run of triangles of one surface.
  struct Shell {
    std::size_t first = 0;
    std::size_t count = 0;
    bool closed = true;  ///< it bounds a solid
  };

  std::vector<std::array<Vector3, 3>>
      triangles;             ///< [m] in the mesh's frame M, counter-clockwise seen from outside
  std::vector<Color> paint;  ///< one per triangle
  std::vector<Shell> shells;

  [[nodiscard]] Eigen::AlignedBox3d box() const;
};

/// Whether the point is inside one of the closed shells, by ray parity for each shell: tests every triangle.
[[nodiscard]] bool insideAnyShell(const PartMesh& mesh, const Vector3& p_MP);

/// Writes binary STL in millimetres, with the colour of each triangle in 15 bits. The same mesh gives the
/// same bytes on every machine. Fails when the file cannot be written.
[[nodiscard]] Result<void> writeStl(const std::filesystem::path& file, const PartMesh& mesh);

}  // namespace tenon::part_generator
