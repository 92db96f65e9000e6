#pragma once

#include <filesystem>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon::bake {

class VoxelSet;

/// Whether the extension is that of an OctoMap: `.bt` (free or occupied) or `.ot` (occupancy probabilities).
[[nodiscard]] bool isOctree(const std::filesystem::path& file);

/// The surface of an OctoMap's occupied cells: two triangles per face, three corners [m] per triangle. An
/// OctoMap is always in metres. Errors do not name the file.
///
/// OctoMap's reader does not validate its input: call this in a process that may crash.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::vector<Vector3f>> readOctreeSurface(const std::filesystem::path& file);

/// Writes cells as occupied leaves, under a temporary name that is then renamed; the extension selects the
/// format. An error when cells are more than 32768 edges away from the origin.
[[nodiscard]] Result<void> writeOctree(const std::filesystem::path& file, const VoxelSet& cells);

}  // namespace tenon::bake
