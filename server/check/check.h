#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "devices/catalog.h"
#include "idl/types/result.h"
#include "server/check/finding.h"
#include "server/game_control/scenario.h"
#include "server/simulation/scene.h"

namespace tenon::check {

struct CheckOptions {
  // of the catalog: how far they turn limits the hands; of an unknown one nothing is checked
  std::string trainee_device{devices::kTraineeDevice};
  std::string instructor_device{devices::kInstructorDevice};
  /// Called with the current activity and its finished fraction [-], 0..1; may be empty.
  std::function<void(std::string_view activity, double fraction)> progress;
};

/// Examines a scenario that can be loaded for what only shows in a session: overlaps at the start and at
/// targets, play against the stated clearance, sizes that cannot be, approaches that are blocked, turns that
/// the device does not have. Findings are in the order of the states. Takes some ten thousand queries for a
/// large scene: a second.
///
/// Parts are assumed to be where the states before have mounted them (game_control::momentsOf). What hands
/// hold is nowhere, but at the start.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] std::vector<Finding> checkScene(const game_control::ScenarioFile& scenario,
                                              const simulation::Scene& scene, const CheckOptions& options);

/// The errors and warnings among what checkScene() finds, a line each: see lineOf.
[[nodiscard]] std::vector<std::string> problems(const game_control::ScenarioFile& scenario,
                                                const simulation::Scene& scene,
                                                const CheckOptions& options = {});

/// Of a scenario that makeScene() refuses: objects out of reach, and `refusal` unless it is the first of
/// them. `structures` by ObjectId.
[[nodiscard]] std::vector<Finding> findingsOf(
    const Error& refusal, const game_control::ScenarioFile& scenario,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& structures);

/// Of a scenario that cannot be baked: sizes of meshes that cannot be, else `refusal`. `boxes_O` [m] by
/// ObjectId: the bounding boxes of the meshes; empty where unknown.
[[nodiscard]] std::vector<Finding> findingsOf(const Error& refusal,
                                              const game_control::ScenarioFile& scenario,
                                              const std::vector<Eigen::AlignedBox3d>& boxes_O);

}  // namespace tenon::check
