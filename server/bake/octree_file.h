#pragma once

#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon {

class VoxelSet;

/// Whether a file's name says that it is an OctoMap: `.bt` (free or occupied) or `.ot` (with probabilities).
[[nodiscard]] bool isOctree(const std::filesystem::path& file);

/// The skin of what an OctoMap holds for occupied: two triangles a face, three corners each [m]. Octrees are
/// in metres, whatever the unit of meshes beside them.
///
/// Reads with OctoMap's own reader, which trusts what it reads: call it where a crash does no harm.
[[nodiscard]] Result<std::vector<Vector3f>> readOctreeSkin(const std::filesystem::path& file);

/// Writes cells as occupied leaves, to a temporary name first; the name's end decides which of the two
/// formats.
[[nodiscard]] Result<void> writeOctree(const std::filesystem::path& file, const VoxelSet& cells);

}  // namespace tenon
