#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "server/check/check.h"
#include "server/check/contact_probe.h"
#include "server/game_control/quantity_text.h"
#include "server/game_control/scenario_moments.h"

namespace tenon::check {

using game_control::inDegrees;
using game_control::inMillimetres;
using game_control::pointText;

/// What all checks of a scene share.
struct CheckedScene {
  const game_control::ScenarioFile& scenario;
  const simulation::Scene& scene;
  const CheckOptions& options;
  std::vector<game_control::SceneMoment> moments;  ///< by state
  std::vector<Finding> findings;

  [[nodiscard]] const std::string& titleOf(ObjectId object) const {
    return scenario.objects[object.value].title.front().text;
  }
  /// What `part` may meet in the state: other objects that no hand holds, unless `with_hands`.
  [[nodiscard]] std::vector<PartObstacle> obstaclesOf(ObjectId part, std::size_t state,
                                                      bool with_hands) const;
};

/// The error of a field that is taken for no overlap: a corner in a concave place has it.
inline constexpr ProbeTolerance kFieldError{20e-6, 0.35};

/// [-] A part that is longer than what it fits into by this factor has a wrong unit.
inline constexpr double kLargestRatio = 20.0;

/// Objects that are inside each other where they appear: at the start, and when a state places them.
void checkOverlaps(CheckedScene& checked);
/// The place of the part of state `state`: size, overlap, play, approach.
void checkTarget(CheckedScene& checked, std::size_t state);
/// Turns from where parts are taken to their targets.
void checkTurns(CheckedScene& checked);
/// Parts that are far larger or smaller than what they fit into, from their sizes alone. `boxes_O` [m] as in
/// findingsOf.
[[nodiscard]] std::vector<Finding> checkSizes(const game_control::ScenarioFile& scenario,
                                              const std::vector<Eigen::AlignedBox3d>& boxes_O);
/// Of a part that is `ratio` [-] times as large as what it fits into.
[[nodiscard]] Finding scaleFinding(const game_control::ScenarioFile& scenario, ObjectId part, ObjectId other,
                                   double ratio);

/// The position of the origin of a part, now at X_WO, that is free of all obstacles, as a hint: "it is free
/// at [0, 0, 0.02]". Found by translations by up to `furthest` [m] along the normal
/// of `place`, where it is deepest; empty when there is none.
[[nodiscard]] std::string wayOut(ContactProbe& probe, std::span<const PartObstacle> obstacles,
                                 const Pose& X_WO, const NearestPlace& place, double furthest);

}  // namespace tenon::check
