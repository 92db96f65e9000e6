#pragma once

#include "clients/report/session_analysis.h"
#include "idl/types/result.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

struct InsertionResult {
  report::SessionAnalysis
      analysis;  ///< force, penetration, load and computation time over the insertion, as in Fig. 9
  Table table;
};

/// A simulated trainee mounts the control box, in one process: the paper's Fig. 9. Fails when the box is not
/// mounted.
[[nodiscard]] Result<InsertionResult> rehearseInsertion(const session::LoadedScene& loaded,
                                                        const ProgressCallback& progress);

}  // namespace tenon::bench
