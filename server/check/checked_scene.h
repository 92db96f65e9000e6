#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "server/check/contact_probe.h"
#include "server/check/finding.h"
#include "server/game_control/quantity_text.h"
#include "server/game_control/scenario_moments.h"

namespace tenon::check {

using game_control::inDegrees;
using game_control::inMillimetres;
using game_control::inPercent;
using game_control::pointText;

/// What all checks of a scene share.
struct CheckedScene {
  const game_control::ScenarioFile& scenario;
  const simulation::Scene& scene;
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

/// The position of the origin of a part, now at X_WO, that is free of all obstacles, as a hint: "it is free
/// at [0, 0, 0.02]". Found by translations by up to `furthest` [m] along the normal of `place`, where it is
/// deepest: inside of an obstacle (assert). Empty when there is none.
[[nodiscard]] std::string freePoseHint(ContactProbe& probe, std::span<const PartObstacle> obstacles,
                                       const Pose& X_WO, const NearestPlace& place, double furthest);

}  // namespace tenon::check
