#pragma once

#include "server/bake/welded_mesh.h"
#include "server/structures/feature_shell.h"

namespace tenon::bake {

/// The sharp features of a mesh whose field is `field` and whose pointshell has points `spacing` [m] apart:
/// corners, convex edges cut into pieces, and points on round surfaces that are too tight for such a spacing,
/// the denser the tighter. Edges between faces that turn by less than 3 degrees are no features, nor are
/// edges with more than two triangles.
[[nodiscard]] structures::FeatureShell bakeFeatures(const WeldedMesh& mesh,
                                                    const structures::DistanceField& field, double spacing);

}  // namespace tenon::bake
