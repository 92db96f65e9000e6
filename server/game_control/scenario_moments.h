#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"
#include "server/game_control/scenario.h"

namespace tenon::game_control {

/// The scene at the begin of a state, after its effects, when everything before was done as the scenario
/// asks: parts are at the targets of their states. Free bodies stay where they were put: that they fall is
/// not foreseen. Indices as in the ScenarioFile.
struct SceneMoment {
  std::vector<Pose> X_WO;
  std::vector<bool> shown;             ///< in the scene: displayed, and in collisions
  std::vector<std::uint32_t> group;    ///< as ScenarioObject::group
  std::vector<bool> pair_enabled;      ///< by pair
  std::vector<ObjectId> hand_objects;  ///< by hand: what it moves
  std::vector<bool> own_object;        ///< of a hand: a pointer or a tool, whose pose only its person knows

  /// A hand moves it: X_WO is where it was taken.
  [[nodiscard]] bool inAHand(ObjectId object) const;
  /// Whether pair `pair` collides: enabled, both objects shown, and not in one group.
  [[nodiscard]] bool collides(const ScenarioFile& scenario, std::size_t pair) const;
};

/// One moment a state.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] std::vector<SceneMoment> momentsOf(const ScenarioFile& scenario);

/// Index of the first state that has a target for the object; none: it has no target.
[[nodiscard]] std::optional<std::size_t> firstTarget(const ScenarioFile& scenario, ObjectId object);

}  // namespace tenon::game_control
