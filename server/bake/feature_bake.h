#pragma once

#include "server/bake/triangle_tree.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/feature_shell.h"

namespace tenon::bake {

/// The sharp features of a mesh whose field is `field` and whose pointshell has points `spacing` [m] apart:
/// corners, convex edges cut into pieces, and points on round surfaces that are too tight for such a spacing,
/// the denser the tighter.
///
/// An edge is sharp when its faces turn by 40 degrees or more. Where they turn by less, they are facets of a
/// round surface, whose radius follows from their width; a long ridge of one (a tube) is no feature, since
/// points of another part see it. No features are edges with more than two triangles, and edges between faces
/// that turn by less than 3 degrees. `surface`: the exposed triangles, for FeatureEdge::reach.
[[nodiscard]] structures::FeatureShell bakeFeatures(const WeldedMesh& mesh, const TriangleTree& surface,
                                                    const structures::DistanceField& field, double spacing);

}  // namespace tenon::bake
