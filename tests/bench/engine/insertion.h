#pragma once

#include <filesystem>

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

/// A simulated trainee mounts the control box, in one process: the paper's Fig. 9. `detail` [-] of the
/// generated parts, 0 to 1. Fails when the scene cannot be loaded or the box is not mounted.
[[nodiscard]] Result<InsertionResult> rehearseInsertion(const std::filesystem::path& scenario,
                                                        const std::filesystem::path& cache, double detail,
                                                        const ProgressCallback& progress);

}  // namespace tenon::bench
