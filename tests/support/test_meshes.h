#pragma once

#include "server/bake/bake.h"

namespace tenon::test {

/// A ball of 4^level * 20 triangles about `centre`.
[[nodiscard]] TriangleMesh ballMesh(double radius, int level, const Vector3& centre = Vector3::Zero());

/// A box of 12 triangles.
[[nodiscard]] TriangleMesh boxMesh(const Vector3& from, const Vector3& to);

/// A ring about the z axis: radius of its middle line, radius of its tube, facets around each.
[[nodiscard]] TriangleMesh torusMesh(double ring, double tube, int around_ring, int around_tube);

/// A flat rectangle at height z, without thickness, 2 n^2 triangles.
[[nodiscard]] TriangleMesh sheetMesh(double half_edge, double z, int n);

/// Both, as they are: a union when they overlap.
[[nodiscard]] TriangleMesh together(const TriangleMesh& a, const TriangleMesh& b);

/// The same triangles, each flipped or not by a fixed random choice.
[[nodiscard]] TriangleMesh randomlyFlipped(TriangleMesh mesh, std::uint64_t seed);

}  // namespace tenon::test
