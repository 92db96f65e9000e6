#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/bake/bake.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

/// A welded mesh: equal positions are one vertex. Its order does not depend on winding, duplicates or the
/// order of the input.
///
/// Vertex numbers are ranks of positions, and each triangle lists its vertices in ascending order. Triangles
/// without area and duplicates are skipped. Open edges that are one line of the shape are stitched, since
/// CAD programs tessellate each face by itself: vertices of theirs that differ by rounding (kStitch) become
/// one, and a triangle is split where a vertex of another one is on its open edge (a T-junction). A hole of
/// one triangle, bounded by three open edges and without a sharp angle to at least one neighbour, is closed:
/// such a triangle is missing in the file, and the flood fill would enter the solid through a large one.
///
/// Threads: constant after construction. Real-time: no.
struct WeldedMesh {
  using Corners = std::array<std::uint32_t, 3>;

  explicit WeldedMesh(const TriangleMesh& mesh);

  /// An edge with one or two triangles.
  struct Edge {
    std::uint32_t from, to;       ///< vertices
    std::uint32_t first, second;  ///< triangles; second is kNone for an open edge
    static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  };
  /// Edges with one triangle or two. Open edges are returned only if they are less than a third of all edges.
  [[nodiscard]] std::vector<Edge> edges() const;
  /// Those of edges() that are open, or whose dihedral angle is less than 140 degrees.
  [[nodiscard]] std::vector<Edge> sharpEdges() const;

  /// The number of each triangle's connected component (triangles with a common vertex), and the number of
  /// components.
  [[nodiscard]] std::pair<std::vector<std::uint32_t>, std::uint32_t> components() const;

  /// [m] Vertices of open edges closer than this, or than 1e-4 of the mesh's diagonal, are one.
  static constexpr double kStitch = 5e-6;

  std::size_t skipped = 0;         ///< triangles without area, or duplicates
  std::size_t joined = 0;          ///< vertices of open edges that became another one
  std::size_t split = 0;           ///< open edges at T-junctions
  std::size_t closed = 0;          ///< holes; the triangles that close them are the last ones
  std::vector<Vector3> positions;  ///< those of joined vertices are not used
  std::vector<Corners> corners;
  std::vector<structures::Triangle> triangles;
  /// Of each triangle how many of the mesh have its corners in this order, less those in the other one [-]; 0
  /// of closed holes. Only what is said about a mesh may depend on it.
  std::vector<std::int8_t> winding;

 private:
  struct HalfEdge {
    std::uint32_t from, to, triangle;
    auto operator<=>(const HalfEdge&) const = default;
  };
  struct WoundCorners {
    Corners corners;
    std::int8_t winding;  // of the mesh's triangle, beside ascending order
    auto operator<=>(const WoundCorners&) const = default;
  };
  /// A triangle with `winding` in the order of these corners.
  [[nodiscard]] static WoundCorners inAscendingOrder(Corners corners, int winding);
  /// Replaces the triangles by `all`, without those that have no area or are there before.
  void build(std::vector<WoundCorners> all);
  /// The edges of all triangles, sorted by their vertices.
  [[nodiscard]] std::vector<HalfEdge> halfEdges() const;
  /// Those of one triangle.
  [[nodiscard]] std::vector<HalfEdge> openEdges() const;
  void stitch();
  /// Makes one of vertices of open edges that are closer than `near` [m].
  void joinVertices(const std::vector<HalfEdge>& open, double near);
  /// Splits open edges at vertices of others closer than `near` [m], at most one edge of each triangle;
  /// false: there was none.
  bool splitEdges(double near);
  void closeHoles();
  /// Edges with one triangle, or with two the cosine of whose dihedral angle is above `cosine` [-] (-1:
  /// flat).
  [[nodiscard]] std::vector<Edge> edgesAbove(double cosine) const;
  /// [-] Cosine of the dihedral angle at edge a-b between a triangle and vertex `beyond`: -1 flat, 1 folded
  /// back.
  [[nodiscard]] double dihedralCosine(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                                      std::uint32_t beyond) const;
};

}  // namespace tenon::bake
