#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "server/bake/bake.h"

namespace tenon::bake {

/// A mesh as displays show it: a binary glTF file, y up as glTF demands (p_glTF = (x, z, -y) of the object's
/// frame), in metres, quantised (KHR_mesh_quantization) and compressed (EXT_meshopt_compression).
struct DisplayModel {
  std::vector<std::uint8_t> glb;
  std::uint32_t triangles = 0;
  double error = 0.0;  ///< [m] largest deviation from the mesh that the simplification estimates
};

/// Triangles of the levels of a display model at most; a level that would equal the one before is not made.
inline constexpr std::array<std::uint32_t, 2> kDisplayTriangles{150'000, 40'000};

/// The levels of a mesh, the finest first; edges sharper than 35 degrees stay visible, and so do borders of
/// colours. A mesh with colours has them in its model (COLOR_0), with `uncolored` (0xRRGGBB, sRGB) for
/// triangles without one. Fails for a mesh without area.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] Result<std::vector<DisplayModel>> displayModels(const TriangleMesh& mesh,
                                                              std::uint32_t uncolored);

/// A hash of the contents of mesh files of unit `unit` [m], of `uncolored` and of how displayModels works:
/// equal keys, equal models. Fails when a file cannot be read.
[[nodiscard]] Result<std::string> displayKey(const std::vector<std::filesystem::path>& meshes, double unit,
                                             std::uint32_t uncolored);

/// importMesh and displayModels of several files, of unit `unit` [m], as one object.
[[nodiscard]] Result<std::vector<DisplayModel>> displayModelsOf(
    const std::vector<std::filesystem::path>& meshes, double unit, std::uint32_t uncolored,
    const BakeProgress& progress = {});

}  // namespace tenon::bake
