#pragma once

#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/surface_tree.h"

namespace tenon {

/// The outer surface of what structures were baked from, read again. `meshes` empty: from where they lay
/// then. The unit of the files is the one that makes them as large as the structures say; files of another
/// size are refused.
[[nodiscard]] Result<SurfaceTree> importSurface(const HapticStructures& structures,
                                                std::vector<std::filesystem::path> meshes = {});

}  // namespace tenon
