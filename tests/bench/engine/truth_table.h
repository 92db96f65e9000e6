#pragma once

#include "idl/types/result.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 4: what queries in contact say, beside the meshes of the solids that the engine bay is made of; with
/// the field alone, and refined.
[[nodiscard]] Result<Table> truthTable(const BenchScene& scene, double detail, int rounds, const Say& say);

}  // namespace tenon::bench
