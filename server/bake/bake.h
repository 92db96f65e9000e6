#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"
#include "server/structures/haptic_structures.h"

namespace tenon {

/// Triangles as they came: no welding, no normals, no promise of watertightness. Metres, frame M.
struct TriangleMesh {
  std::vector<Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::string> notes;  ///< what the import dropped or changed, a sentence each
};

/// A region whose surface is baked at voxel / refinement (see DistanceField).
struct RefineBox {
  Eigen::AlignedBox3d box_M;
};

struct BakeOptions {
  double voxel = 0.003;         ///< [m]
  std::int32_t refinement = 4;  ///< of the boxes below; 1, 2, 4 or 8
  std::vector<RefineBox> refine;
  double point_spacing = 0.0;     ///< [m] between shell points; 0: chosen from `points`
  std::uint32_t points = 10'000;  ///< about how many shell points, when point_spacing is 0
};

/// Called with a share of 0..1 and what is being done; returning false cancels the bake.
using BakeProgress = std::function<bool(double share, std::string_view doing)>;

/// Reads a mesh with assimp in a child process that has limits on memory and time: a file that crashes or
/// hangs the importer is one clear error here. `unit` is the length of one file unit [m]. A scan (`.bt`,
/// `.ot` of OctoMap) becomes the skin of its occupied cells, always in metres.
[[nodiscard]] Result<TriangleMesh> importMesh(const std::filesystem::path& file, double unit);

/// Turns triangles into haptic structures (paper §3.1): field, shell and tree, from positions alone.
[[nodiscard]] Result<HapticStructures> bake(const TriangleMesh& mesh, const BakeOptions& options,
                                            const BakeProgress& progress = {});

/// `importMesh` and `bake` of several files as one object.
[[nodiscard]] Result<HapticStructures> bakeFiles(const std::vector<std::filesystem::path>& meshes,
                                                 double unit, const BakeOptions& options,
                                                 const BakeProgress& progress = {});

/// `bakeFiles` through a cache folder keyed by content and options.
/// Gives the structure file's path.
[[nodiscard]] Result<std::filesystem::path> bakeCached(const std::vector<std::filesystem::path>& meshes,
                                                       double unit, const BakeOptions& options,
                                                       const std::filesystem::path& cache_folder,
                                                       const BakeProgress& progress = {});

}  // namespace tenon
