#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/bake/bake.h"
#include "server/bake/triangle.h"

namespace tenon {

/// Triangles with equal corners known as equal, in an order that winding and duplicates do not change.
///
/// Corner numbers are ranks of positions, and each triangle lists its corners in rising order. Triangles
/// without area and repeated ones are left out.
struct WeldedMesh {
  using Corners = std::array<std::uint32_t, 3>;

  explicit WeldedMesh(const TriangleMesh& mesh);

  /// Where two triangles meet at an angle, or one ends.
  struct Edge {
    std::uint32_t from, to;       ///< corner numbers
    std::uint32_t first, second;  ///< triangles; second is kNone where the surface ends
    static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  };
  /// Edges with one triangle, or with two whose angle is sharper than 140 degrees.
  [[nodiscard]] std::vector<Edge> sharpEdges() const;

  /// A number for each triangle, equal for those connected through corners; and how many numbers there are.
  [[nodiscard]] std::pair<std::vector<std::uint32_t>, std::uint32_t> components() const;

  std::vector<Vector3> positions;
  std::vector<Corners> corners;
  std::vector<Triangle> triangles;
};

}  // namespace tenon
