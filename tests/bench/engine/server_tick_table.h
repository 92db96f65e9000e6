#pragma once

#include "idl/types/result.h"
#include "server/session/scene_loader.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/table.h"

namespace tenon::bench {

/// Wall time of complete server ticks, those in contact apart from free ones, beside the query alone:
/// sessions of simulated people, one seed after the other, until there are at least `ticks`. Fails when a
/// session cannot begin, or when nothing came into contact.
[[nodiscard]] Result<Table> serverTickTable(const session::LoadedScene& loaded, std::size_t ticks,
                                            const ProgressCallback& progress);

}  // namespace tenon::bench
