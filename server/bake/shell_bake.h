#pragma once

#include <span>

#include "server/bake/bake.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/triangle.h"

namespace tenon {

class ParallelWork;

/// An even sampling of the surface that the outside touches, sharp convex edges and corners first, with
/// normals from the field: a pointshell (paper §3.1). `surface` is what is left of the mesh after hiding the
/// inside.
[[nodiscard]] Pointshell bakeShell(const WeldedMesh& mesh, std::span<const Triangle> surface,
                                   const DistanceField& field, const BakeOptions& options,
                                   ParallelWork& work);

}  // namespace tenon
