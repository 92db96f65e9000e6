#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/distance_field.h"
#include "server/structures/feature_shell.h"
#include "server/structures/filled_space.h"
#include "server/structures/pointshell.h"

namespace tenon::structures {

/// Source and size of haptic structures.
struct StructureInfo {
  std::string source;               ///< file names of the meshes
  std::string content_hash;         ///< of meshes and options: the file's name in a cache
  std::uint64_t triangles = 0;      ///< of the meshes
  double bake_seconds = 0.0;        ///< [s]
  Eigen::AlignedBox3d box_M;        ///< [m] bounding box of the mesh
  double surface_area = 0.0;        ///< [m^2] of the sampled outer surface
  double thin_area = 0.0;           ///< [m^2] of it where material is too thin for the voxels there
  double open_area = 0.0;           ///< [m^2] of that where a point could pass in spite of the dilation
  std::vector<FilledSpace> filled;  ///< empty space that the field has no room for, the largest walls first
  std::uint64_t bricks = 0;         ///< with samples
  std::vector<std::filesystem::path> meshes;  ///< when baked; stored relative to the structure file's folder
  double unit = 1.0;                          ///< [m] length of one unit of these files
  std::string notes;  ///< one sentence per line, to be printed (connected parts without an inside, ...)
};

/// The haptic structures of one object: a collision pair uses the field of one object and the pointshell of
/// the other, and the features of both.
struct HapticStructures {
  DistanceField field;
  Pointshell shell;
  StructureInfo info;
  FeatureShell features;
};

/// Writes a structure file, versioned, with a checksum. A regular file is written under a temporary name and
/// renamed: a reader never sees an incomplete one. An error when the file cannot be written, or the
/// structures could not be read again (structure_checks.h).
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<void> writeStructures(const std::filesystem::path& file,
                                           const HapticStructures& structures);

/// Reads a structure file into memory of its own, in huge pages where the kernel has them. A wrong version,
/// size or checksum, and structures that are not sound (structure_checks.h), are an error of one sentence
/// that names the file.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::shared_ptr<const HapticStructures>> openStructures(
    const std::filesystem::path& file);

}  // namespace tenon::structures
