#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 3: time of a query for every instruction set and kind of pose, compared with testing every point and
/// with other engines on the same meshes and poses. Times are the smallest of `rounds`.
[[nodiscard]] Table queryTable(const BenchScene& scene, int rounds, const ProgressCallback& progress);

}  // namespace tenon::bench
