#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 9 at scale: whole ticks while free boxes settle on each other, in one contact island.
[[nodiscard]] Table heapsTable(const ProgressCallback& progress);

}  // namespace tenon::bench
