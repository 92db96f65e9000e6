#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 8: more than a tick's work, with and without graceful degradation. What the governor decided is
/// played again without a clock, and the hashes are compared.
[[nodiscard]] Table overloadTable(const Say& say);

}  // namespace tenon::bench
