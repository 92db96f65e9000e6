#pragma once

#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/surface_tree.h"

namespace tenon {

/// The outer surface of what structures were baked from, read again. `meshes` empty: from where they lay
/// then. Files that are not as large as the structures say, in the unit they were baked in, are refused.
[[nodiscard]] Result<SurfaceTree> importSurface(const HapticStructures& structures,
                                                std::vector<std::filesystem::path> meshes = {});

}  // namespace tenon
