#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon {

/// 0xRRGGBB as a display shows it.
using Color = std::uint32_t;

/// Triangles as a CAD export leaves them: shells that overlap, share no vertices and need not be closed.
///
/// Each triangle has its own three corners, because that is what an STL file can say. `shells` keeps what the
/// file forgets (which triangles were one solid), so that a test can ask whether a point is inside one.
struct PartMesh {
  /// A run of triangles that were made together; a closed one has an inside.
  struct Shell {
    std::size_t first = 0;
    std::size_t count = 0;
    bool closed = true;
  };

  std::vector<std::array<Vector3, 3>>
      triangles;             ///< [m] in the mesh's frame M, counter-clockwise from outside
  std::vector<Color> paint;  ///< one a triangle
  std::vector<Shell> shells;

  [[nodiscard]] Eigen::AlignedBox3d box() const;
};

/// Is the point inside one of the closed shells? By ray parity, shell by shell: slow and sure.
[[nodiscard]] bool insideAnyShell(const PartMesh& mesh, const Vector3& p_MP);

/// Writes binary STL in millimetres. The same mesh gives the same bytes on every machine.
[[nodiscard]] Result<void> writeStl(const std::filesystem::path& file, const PartMesh& mesh);

}  // namespace tenon
