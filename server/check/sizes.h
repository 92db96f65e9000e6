#pragma once

#include <vector>

#include "idl/types/spatial.h"
#include "server/check/finding.h"

namespace tenon::check {

/// [-] A part that is longer than what it fits into by this factor has a wrong unit.
inline constexpr double kLargestRatio = 20.0;

/// Parts that are far larger or smaller than what they fit into, from their sizes alone. `boxes_O` [m] by
/// ObjectId: the bounding boxes of the meshes; empty where unknown.
[[nodiscard]] std::vector<Finding> checkSizes(const game_control::ScenarioFile& scenario,
                                              const std::vector<Eigen::AlignedBox3d>& boxes_O);

/// Of a part that is `ratio` [-] times as large as what it fits into.
[[nodiscard]] Finding scaleFinding(const game_control::ScenarioFile& scenario, ObjectId part, ObjectId other,
                                   double ratio);

}  // namespace tenon::check
