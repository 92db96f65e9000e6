#pragma once

#include <span>

#include "server/bake/bake.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

class ParallelWork;

/// The pointshell of a mesh (paper §3.1): an even sampling of its exposed surface, sharp convex edges and
/// corners first, with normals from the field. `surface` is the exposed part of the mesh. Twelve
/// candidates are drawn per wanted point, 12 million at most: more than a million points come out sparser
/// than asked for.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] structures::Pointshell bakeShell(const WeldedMesh& mesh,
                                               std::span<const structures::Triangle> surface,
                                               const structures::DistanceField& field,
                                               const BakeOptions& options, ParallelWork& work);

}  // namespace tenon::bake
