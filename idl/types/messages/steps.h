#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/localized_text.h"
#include "idl/types/spatial.h"

/// The steps of a scenario.
namespace tenon {

enum class StepPhase : std::uint32_t { kWaiting, kActive, kDone, kTimedOut, kSkipped };

/// The current step of the scenario as displays show it: what the trainee has to do.
struct StepState {
  std::uint32_t revision = 0;  ///< counts changes of this state
  std::uint32_t step = 0;      ///< index of the current step
  std::uint32_t steps = 0;     ///< of the scenario
  std::string name;
  std::vector<LocalizedText> title;
  std::vector<LocalizedText> instruction;
  StepPhase phase = StepPhase::kWaiting;
  std::string part;  ///< title of the part this step belongs to, for grouping on displays; may be empty
  ObjectId object;   ///< to be touched, moved or used; may be invalid
  HandId hand;       ///< that has to do it
  ObjectId touch;    ///< to be touched, when the step is a touch; else invalid
  bool has_target = false;
  Pose X_WG;                             ///< target pose of `object`, displayed as a ghost
  Vector3 approach_W = Vector3::Zero();  ///< unit insertion direction; zero: any
  double approach_distance = 0.0;        ///< [m] length of the insertion path before the target
  double tolerance = 0.0;                ///< [m] of the target position
  double angle_tolerance = 0.0;          ///< [rad] of the target orientation
  double timeout = 0.0;                  ///< [s], 0 for none
  Tick started = 0;
};

/// The constant data of a step, for lists of all steps.
struct SceneStep {
  std::uint32_t step = 0;   ///< index
  std::uint32_t steps = 0;  ///< of the scenario
  std::string name;
  std::vector<LocalizedText> title;
  std::string part;  ///< as in StepState
};

/// The title of the scenario in its languages: SessionAnnounce has that of the main one.
struct SceneTitle {
  std::vector<LocalizedText> titles;
};

/// An external signal for which conditions of the scenario wait, by the name that a Command gives.
struct SceneSignal {
  std::uint32_t signal = 0;  ///< index, in the order of first use
  std::string name;
};

/// What a node of a condition tree is.
enum class ConditionGroup : std::uint8_t {
  kSingle,  ///< a condition
  kAll,     ///< met when all of its children are
  kAny,     ///< met when one of its children is
};

/// A node of the condition tree of a step (paper Fig. 4): a condition, or a group of those that follow it at
/// a larger depth.
struct ConditionValue {
  std::string text;   ///< as in the scenario: "pose of control_box", "contact pointer-control_box"
  float value = 0.0;  ///< [m], [N], [s] or [-], by the kind of the condition; group: children that are met
  float limit = 0.0;  ///< [m], [N], [s] or [-] in the unit of `value`
  ConditionGroup group = ConditionGroup::kSingle;
  bool met = false;
  std::uint8_t depth = 0;  ///< groups around it; a root that asks for all of its children is not told
};

inline constexpr std::size_t kMostConditionsTold = 12;  ///< in a StepProgress

/// How far the current step is fulfilled.
struct StepProgress {
  std::uint32_t revision = 0;    ///< of the StepState
  Tick tick = 0;                 ///< that it was sent in; the values are those at its beginning
  double position_error = 0.0;   ///< [m] of the object from its target
  double angle_error = 0.0;      ///< [rad] of the object from its target
  double contact_seconds = 0.0;  ///< [s] of contact of the object in this step
  std::uint32_t nodes = 0;       ///< of the condition tree: `conditions` are the first kMostConditionsTold
  std::vector<ConditionValue> conditions;  ///< parents before their children, in the scenario's order
};

}  // namespace tenon
