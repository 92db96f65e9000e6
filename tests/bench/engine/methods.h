#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 5: the god object compared with the paper's blocking heuristic and its penalty force. All figures but
/// the times are the same on every machine.
[[nodiscard]] Table methodsTable(const ProgressCallback& progress);

}  // namespace tenon::bench
