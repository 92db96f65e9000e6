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

struct SceneWishes {
  std::filesystem::path folder;  ///< parts and structures are made here
  double detail = 1.0;           ///< of the generated parts; 1 is the paper's scene
};

/// The paper's pair: the engine bay at 3 mm as a field, the control box as a shell of about 10,500 points.
struct BenchScene {
  std::shared_ptr<const HapticStructures> bay, box;
  TriangleMesh bay_mesh, box_mesh;
  PoseSets poses;  ///< X of the box in the bay, on its way into its place
  Table bake;      ///< what making them took
};

/// What is being done, for a person who waits.
using Say = std::function<void(std::string_view)>;

/// Has the parts made and baked anew by the programs beside this one, so that their time and memory are those
/// of a user.
[[nodiscard]] Result<BenchScene> makeScene(const SceneWishes& wishes, const Say& say);

}  // namespace tenon::bench
