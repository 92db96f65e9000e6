#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Time of a tick's query by kind of pose, beside other engines on the same meshes, poses and rounds. Times
/// are the smallest of `rounds`.
[[nodiscard]] Table queryTable(const BenchPair& pair, int rounds, const ProgressCallback& progress);

}  // namespace tenon::bench
