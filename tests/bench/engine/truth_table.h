#pragma once

#include "idl/types/result.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 4: errors of queries in contact with respect to the meshes of the engine bay's solids: field
/// interpolated, with ridge correction, and refined by the mesh. `detail` [-] of the generated parts, 0 to 1.
/// Times are the smallest of `rounds`. Fails when the scenario has no engine bay.
[[nodiscard]] Result<Table> truthTable(const BenchScene& scene, double detail, int rounds,
                                       const ProgressCallback& progress);

}  // namespace tenon::bench
