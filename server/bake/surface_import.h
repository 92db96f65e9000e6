#pragma once

#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/surface_tree.h"

namespace tenon::bake {

/// Imports again the meshes that structures were baked from, in the unit they were baked in, and returns
/// their outer surface. With `meshes` empty the paths of baking time are used. An error when a file cannot be
/// imported or the bounding box is not that of the structures.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<structures::SurfaceTree> importSurface(const structures::HapticStructures& structures,
                                                            std::vector<std::filesystem::path> meshes = {});

}  // namespace tenon::bake
