#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon::game_control {

/// Reads the array of states (paper Fig. 4) in order. It tracks which hand moves which object, what is hidden
/// and which groups there are, so that a state whose task cannot be done is an error with its line.
///
/// Threads: one. Real-time: no.
class ScenarioStateReader {
 public:
  /// Objects, hands and pairs of `scenario` have been read; `taken` by hands at the start, with valid ids.
  ScenarioStateReader(YamlReader& yaml, ScenarioFile& scenario, const std::vector<HandAssignment>& taken);

  /// Appends the states to the scenario; errors go to the YamlReader.
  void read(const YAML::Node& states);
  /// Appends a state without effects and task that lasts until somebody sends kFulfilled.
  void addEndlessState();

 private:
  [[nodiscard]] ScenarioState readState(const YAML::Node& node);
  // effects at the beginning of a state: server/game_control/scenario_state_effects.cpp
  void readEffects(const YAML::Node& node, ScenarioState& state);
  void readGroups(const YAML::Node& node, ScenarioState& state);
  void readPlacements(const YAML::Node& node, const std::string& key, PlacementKind kind,
                      ScenarioState& state);
  void readHands(const YAML::Node& node, ScenarioState& state);
  void readHelpers(const YAML::Node& node, ScenarioState& state);
  bool checkGrab(const YAML::detail::iterator_value& entry, HandId hand, ObjectId object,
                 const std::string& what);
  void checkGroups();
  // the task
  void readTask(const YAML::Node& node, ScenarioState& state);
  void readTarget(const YAML::Node& node, ScenarioState& state);
  void readApproach(const YAML::Node& node, ScenarioState& state);
  void readEnd(const YAML::Node& node, ScenarioState& state);
  void showTouchedObject(ScenarioState& state);
  void useDefaultConditions(const YAML::Node& node, ScenarioState& state);
  void checkFeasible(const YAML::Node& node, const ScenarioState& state);
  [[nodiscard]] bool inSameGroup(ObjectId a, ObjectId b) const;  ///< in the state being read
  [[nodiscard]] HandId handMoving(ObjectId object) const;        ///< invalid: none
  [[nodiscard]] HandId firstCoupledHand() const;                 ///< of a trainee; hand 0 when there is none
  /// "'key' of state 'name'", for errors.
  [[nodiscard]] std::string describeKey(const ScenarioState& state, const std::string& key) const;

  YamlReader& yaml_;
  ScenarioFile& scenario_;
  ScenarioNames names_;
  std::vector<HandAssignment> taken_;
  std::vector<ObjectId> object_of_hand_;  ///< by hand: the object it moves in the state being read
  std::vector<bool> hidden_;              ///< by object
  std::vector<std::uint32_t> group_;      ///< by object
};

}  // namespace tenon::game_control
