#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 7: whole ticks with many objects that may all collide with each other.
[[nodiscard]] Table manyBodiesTable(const ProgressCallback& progress);

}  // namespace tenon::bench
