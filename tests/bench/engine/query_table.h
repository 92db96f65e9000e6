#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 3: time of a query for every instruction set, by kind of pose, beside the flat loop over all points
/// and beside other engines on the same meshes and poses.
[[nodiscard]] Table queryTable(const BenchScene& scene, int rounds, const Say& say);

}  // namespace tenon::bench
