#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Errors of gaps and net forces with respect to the exact distances of the bay's solids: as ticks ask, and
/// with the ridge correction that they do without. Times are the smallest of `rounds`.
[[nodiscard]] Table truthTable(const BenchPair& pair, int rounds, const ProgressCallback& progress);

}  // namespace tenon::bench
