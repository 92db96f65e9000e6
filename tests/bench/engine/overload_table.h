#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 8: overload with and without graceful degradation. The run is repeated without a clock with the
/// budgets that the governor chose, and the state hashes are compared.
[[nodiscard]] Table overloadTable(const ProgressCallback& progress);

}  // namespace tenon::bench
