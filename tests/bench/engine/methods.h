#pragma once

#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Item 5: the god object beside the paper's blocking heuristic and its penalty force. Counted figures are
/// the same on every machine.
[[nodiscard]] Table methodsTable(const Say& say);

}  // namespace tenon::bench
