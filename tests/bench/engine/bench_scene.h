#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "idl/types/result.h"
#include "server/bake/bake.h"
#include "server/structures/haptic_structures.h"
#include "tests/bench/engine/pose_sets.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

struct BenchSceneOptions {
  std::filesystem::path folder;  ///< for generated parts and structures
  double detail = 1.0;           ///< [-] of the generated parts, 0 to 1; 1 is the paper's scene
};

/// The paper's collision pair: the engine bay as SDF side with 3 mm voxels, the control box as pointshell
/// side with about 10,500 points.
struct BenchScene {
  std::shared_ptr<const structures::HapticStructures> bay, box;
  bake::TriangleMesh bay_mesh, box_mesh;
  PoseSets poses;  ///< of the box in the bay, on its path to its target
  Table bake;      ///< cost of baking both
};

/// Receives a description of the current step, for display.
using ProgressCallback = std::function<void(std::string_view)>;

/// Generates and bakes the parts by running the installed programs, so that time and memory are those of a
/// user. Fails when a program fails or the files cannot be read.
[[nodiscard]] Result<BenchScene> makeScene(const BenchSceneOptions& options,
                                           const ProgressCallback& progress);

}  // namespace tenon::bench
