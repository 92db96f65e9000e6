#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/bench/engine/table.h"
#include "tests/bench/stability/rig_cell.h"

namespace tenon::bench {

[[nodiscard]] std::string_view nameOf(RigModel model);
/// All that can be measured.
[[nodiscard]] std::vector<RigModel> rigModels();
[[nodiscard]] std::vector<RigLoss> rigLosses();

/// A table for each situation, a row for each cell.
[[nodiscard]] std::vector<Table> stabilityTables(const std::vector<RigSituation>& situations,
                                                 const std::vector<RigCell>& cells);
[[nodiscard]] nlohmann::json stabilityJson(std::uint64_t seed, const std::vector<Table>& tables);
/// An SVG: for each situation largest stable stiffness and error of the felt force over the delay, a line for
/// each model, the worst of all losses.
[[nodiscard]] std::string stabilityPlot(const std::vector<RigSituation>& situations,
                                        const std::vector<RigCell>& cells);

}  // namespace tenon::bench
