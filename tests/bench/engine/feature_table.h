#pragma once

#include "idl/types/result.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// What the second direction of pairs costs, features and crossings of edges: a simulated trainee works
/// through a scenario, and queries of its pairs are made again at the poses of sampled ticks, with and
/// without features.
[[nodiscard]] Result<Table> featureTable(const session::LoadedScene& loaded, int rounds,
                                         const ProgressCallback& progress);

}  // namespace tenon::bench
