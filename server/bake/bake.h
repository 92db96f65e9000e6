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

namespace tenon::bake {

inline constexpr std::uint32_t kNoColor = 0xFFFFFFFF;

/// A triangle soup as imported: not welded, without normals, not necessarily watertight. Frame M.
struct TriangleMesh {
  std::vector<Vector3f> vertices;  ///< [m]
  std::vector<std::array<std::uint32_t, 3>> triangles;
  /// 0xRRGGBB, sRGB: one for each triangle, kNoColor where its file has none; empty when no file has colours.
  /// They are for displays: what is baked does not depend on them.
  std::vector<std::uint32_t> colors;
  std::vector<std::string> notes;  ///< one sentence for each thing that the import skipped or changed
};

/// A region whose surface is baked with edge voxel / refinement (see DistanceField).
struct RefineBox {
  Eigen::AlignedBox3d box_M;
};

struct BakeOptions {
  double voxel = 0.003;         ///< [m]
  std::int32_t refinement = 4;  ///< [-] divides `voxel` in the boxes of `refine`; 1, 2, 4 or 8
  std::vector<RefineBox> refine;
  double point_spacing = 0.0;     ///< [m] between shell points; 0: chosen from `points`
  std::uint32_t points = 10'000;  ///< approximate number of shell points, when point_spacing is 0
};

/// Fails with the first option that is out of range.
///
/// Threads: pure.
[[nodiscard]] Result<void> checkOptions(const BakeOptions& options);

/// Called with the fraction done [0..1] and the name of the stage; returning false cancels the bake.
using BakeProgress = std::function<bool(double fraction, std::string_view stage)>;

inline constexpr std::string_view kReadingMeshes = "reading meshes";  ///< the first stage

/// Reads a mesh with assimp. `unit` [m] is the length of one unit of the file. A scan (`.bt`, `.ot` of
/// OctoMap) gives the surface of its occupied cells, always in metres. No other files are read than those of
/// referencesOf (mesh_references.h); the mesh and its folder may be symbolic links. The import runs in a
/// child process ($TENON_BAKE, or tenon-bake beside this program) with limits on memory and time: a file that
/// crashes the importer or exceeds a limit is an error of one sentence that names the file. `progress` is
/// called ten times a second with a fraction of 0, and ends the child when it cancels.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<TriangleMesh> importMesh(const std::filesystem::path& file, double unit,
                                              const BakeProgress& progress = {});

/// Computes field and pointshell of a triangle soup (paper §3.1) from positions alone: neither winding nor
/// normals matter. An error when options are out of range, the mesh is invalid or has no area, its field is
/// larger than FieldLimits (field_size.h; with its size and a voxel that fits), or `progress` cancels.
///
/// Threads: any; it uses up to eight threads of its own and calls `progress` on the caller's. Real-time: no.
[[nodiscard]] Result<structures::HapticStructures> bake(const TriangleMesh& mesh, const BakeOptions& options,
                                                        const BakeProgress& progress = {});

/// `importMesh` and `bake` of several files, of unit `unit` [m], as one object.
[[nodiscard]] Result<structures::HapticStructures> bakeFiles(const std::vector<std::filesystem::path>& meshes,
                                                             double unit, const BakeOptions& options,
                                                             const BakeProgress& progress = {});

/// `bakeFiles` of files of unit `unit` [m] through a cache folder; its key is a hash of contents and options.
/// Returns the path of the structure file. Several processes may use one folder: files are renamed into
/// place.
[[nodiscard]] Result<std::filesystem::path> bakeCached(const std::vector<std::filesystem::path>& meshes,
                                                       double unit, const BakeOptions& options,
                                                       const std::filesystem::path& cache_folder,
                                                       const BakeProgress& progress = {});

}  // namespace tenon::bake
