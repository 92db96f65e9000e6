#pragma once

#include <filesystem>

#include "clients/report/session_story.h"
#include "idl/types/result.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

struct Insertion9 {
  SessionStory story;  ///< force, penetration, load and computation time over the insertion, as in Fig. 9
  Table table;
};

/// The control box is mounted by a simulated trainee, in one process: the paper's Fig. 9.
[[nodiscard]] Result<Insertion9> rehearseInsertion(const std::filesystem::path& scenario,
                                                   const std::filesystem::path& cache, double detail,
                                                   const Say& say);

}  // namespace tenon::bench
