#pragma once

#include "server/bake/bake.h"

namespace tenon::test {

/// A ball of `radius` [m] around `centre`, with 4^level * 20 triangles.
[[nodiscard]] bake::TriangleMesh ballMesh(double radius, int level, const Vector3& centre = Vector3::Zero());

/// A box between two corners, 12 triangles.
[[nodiscard]] bake::TriangleMesh boxMesh(const Vector3& from, const Vector3& to);

/// A torus about the z axis: `ring` [m] is the radius of its centre line, `tube` [m] that of its tube;
/// `around_ring` and `around_tube` are numbers of facets.
[[nodiscard]] bake::TriangleMesh torusMesh(double ring, double tube, int around_ring, int around_tube);

/// A flat square from -`half_edge` [m] to `half_edge` at height `z` [m], without thickness, 2 n^2 triangles.
[[nodiscard]] bake::TriangleMesh sheetMesh(double half_edge, double z, int n);

/// The triangles of both meshes, unchanged.
[[nodiscard]] bake::TriangleMesh together(const bake::TriangleMesh& a, const bake::TriangleMesh& b);

/// The same triangles with pseudo-random orientation.
[[nodiscard]] bake::TriangleMesh randomlyFlipped(bake::TriangleMesh mesh, std::uint64_t seed);

}  // namespace tenon::test
