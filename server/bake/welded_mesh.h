#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/bake/bake.h"
#include "server/structures/triangle.h"

namespace tenon {

/// Triangles with equal corners known as equal, in an order that winding and duplicates do not change.
///
/// Corner numbers are ranks of positions, and each triangle lists its corners in rising order. Triangles
/// without area and repeated ones are left out. A hole of one triangle, whose edges all end there and which
/// goes on from a neighbour without a sharp bend, is closed: such a triangle was lost, and through a large
/// one the outside would get into a solid.
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

  std::size_t left_out = 0;  ///< triangles without area, or repeated
  std::size_t closed = 0;    ///< holes; their triangles are the last ones
  std::vector<Vector3> positions;
  std::vector<Corners> corners;
  std::vector<Triangle> triangles;

 private:
  struct Half {
    std::uint32_t from, to, triangle;
    auto operator<=>(const Half&) const = default;
  };
  /// The edges of all triangles, those of one place beside each other.
  [[nodiscard]] std::vector<Half> halves() const;
  void closeHoles();
  /// How a triangle goes on beyond its edge a-b to `beyond`: -1 straight on, 1 folded back.
  [[nodiscard]] double bend(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                            std::uint32_t beyond) const;
};

}  // namespace tenon
