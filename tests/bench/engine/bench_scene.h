#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "idl/types/result.h"
#include "server/bake/bake.h"
#include "server/collision/feature_query.h"
#include "server/session/scene_loader.h"
#include "tests/bench/engine/pose_sets.h"
#include "tests/bench/engine/table.h"
#include "tests/support/solid_union.h"

namespace tenon::bench {

/// Receives a description of the current step, for display.
using ProgressCallback = std::function<void(std::string_view)>;

/// What the solver of a tick asks when it lists the contacts of a pair: up to `margin` [m], and no less than
/// at rest.
[[nodiscard]] collision::PairQuery tickQuery(const simulation::Scene& scene, const simulation::PairSpec& pair,
                                             const Pose& X_WA, const Pose& X_WB, double margin = 0.0);

/// The paper's collision pair as sessions have it: the control box as pointshell side, the engine bay as SDF
/// side.
///
/// Threads: any, constant. Real-time: no.
struct BenchPair {
  std::shared_ptr<const simulation::Scene> scene;
  const simulation::PairSpec* spec = nullptr;
  collision::PairFeatures features;
  bake::TriangleMesh box_mesh, bay_mesh;
  test::SolidUnion truth{{}};  ///< of the bay around the path
  PoseSets poses;              ///< of the box in the bay, on its path to its target

  [[nodiscard]] collision::PairQuery tickQuery(const Pose& X_BA) const {
    return bench::tickQuery(*scene, *spec, X_BA, Pose());
  }
};

/// The measured first start of a scenario: its parts are generated and baked into the empty folder `cache`,
/// and checked, by the installed program, so that time and memory are those of a user. Fails when the program
/// does.
[[nodiscard]] Result<Table> bakeTable(const std::filesystem::path& scenario,
                                      const std::filesystem::path& cache, double detail,
                                      const ProgressCallback& progress);

/// The pair, and poses of it, of a loaded engine bay whose generated parts have `detail` [-], 0..1. Fails
/// when the scenario has no such parts.
[[nodiscard]] Result<BenchPair> makePair(const session::LoadedScene& loaded, double detail,
                                         const ProgressCallback& progress);

}  // namespace tenon::bench
