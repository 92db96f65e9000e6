#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/distance_field.h"
#include "server/structures/pointshell.h"

namespace tenon {

/// Where structures came from and what they are, for people and caches.
struct StructureInfo {
  std::string source;        ///< names of the meshes
  std::string content_hash;  ///< of meshes and options: the name in a cache
  std::uint64_t triangles = 0;
  double bake_seconds = 0.0;
  Eigen::AlignedBox3d box_M;  ///< of the mesh
  double surface_area = 0.0;  ///< [m^2] of the sampled outer surface
  std::uint64_t bricks = 0;
  std::vector<std::filesystem::path> meshes;  ///< where they lay; a file keeps the way there from its folder
  double unit = 1.0;                          ///< [m] of one unit of these files
  std::string notes;  ///< one sentence a line: what a person should know (parts without an inside, ...)
};

/// Both haptic structures of one object: it is asked as a field or as a shell, whichever a pair needs.
struct HapticStructures {
  DistanceField field;
  Pointshell shell;
  StructureInfo info;
};

/// Writes a structure file: versioned, checksummed, to a temporary name first, so a reader never sees half a
/// file.
[[nodiscard]] Result<void> writeStructures(const std::filesystem::path& file,
                                           const HapticStructures& structures);

/// Maps a structure file. Fails with one sentence naming the file on a wrong version, size, or checksum.
[[nodiscard]] Result<std::shared_ptr<const HapticStructures>> openStructures(
    const std::filesystem::path& file);

}  // namespace tenon
