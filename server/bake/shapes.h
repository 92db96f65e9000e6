#pragma once

#include <filesystem>

#include "idl/types/result.h"
#include "server/bake/bake.h"

namespace tenon::bake {

// Meshes of simple solids about the origin of M: closed, each edge between two triangles, normals outward.
// Vertices of a round surface lie on it and facets inside of it, nowhere farther than `deviation` [m]. Only
// operations that IEEE 754 rounds correctly are used, so a shape has the same bytes wherever it is made.
// Lengths are above 0, and `deviation` is below the radius (assert). Threads: pure.

/// A box with `edges` [m] along x, y and z.
[[nodiscard]] TriangleMesh makeBox(const Vector3& edges);

/// A sphere of `radius` [m]; facets up to `deviation` [m] inside of it. Its size along x, y and z is exact.
[[nodiscard]] TriangleMesh makeSphere(double radius, double deviation);

/// A cylinder along z of `radius` [m] and `length` [m]; facets of its side up to `deviation` [m] inside of
/// it.
[[nodiscard]] TriangleMesh makeCylinder(double radius, double length, double deviation);

/// Writes a binary STL whose unit is `unit` [m], under a temporary name that is then renamed. An
/// error names the file.
[[nodiscard]] Result<void> writeStl(const std::filesystem::path& file, const TriangleMesh& mesh, double unit);

}  // namespace tenon::bake
