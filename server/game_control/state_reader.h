#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon {

/// Reads the array of states (paper Fig. 4) in order and follows what each hand moves, so that a state which
/// asks for something nobody can do is an error with its line.
///
/// Threads: one. Real-time: no.
class StateReader {
 public:
  StateReader(YamlReader& yaml, ScenarioFile& scenario);

  void read(const YAML::Node& states);

 private:
  [[nodiscard]] ScenarioState readState(const YAML::Node& node);
  // what a state does when it begins: state_effects.cpp
  void readEffects(const YAML::Node& node, ScenarioState& state);
  void readGroups(const YAML::Node& node, ScenarioState& state);
  void readPlacements(const YAML::Node& node, const std::string& key, PlacementKind kind,
                      ScenarioState& state);
  void readHands(const YAML::Node& node, ScenarioState& state);
  void readHelpers(const YAML::Node& node, ScenarioState& state);
  bool mayTake(const YAML::detail::iterator_value& entry, HandId hand, ObjectId object,
               const std::string& what);
  void checkGroups();
  // what it asks
  void readTask(const YAML::Node& node, ScenarioState& state);
  void readTarget(const YAML::Node& node, ScenarioState& state);
  void readApproach(const YAML::Node& node, ScenarioState& state);
  void readEnd(const YAML::Node& node, ScenarioState& state);
  void appearWhatIsTouched(ScenarioState& state);
  void useDefaultConditions(const YAML::Node& node, ScenarioState& state);
  void checkDoable(const YAML::Node& node, const ScenarioState& state);
  [[nodiscard]] bool ofOneGroup(ObjectId a, ObjectId b) const;  ///< in the state being read
  [[nodiscard]] HandId handMoving(ObjectId object) const;
  [[nodiscard]] HandId firstHand() const;  ///< of a trainee that feels what it moves
  [[nodiscard]] std::string in(const ScenarioState& state, const std::string& key) const;

  YamlReader& yaml_;
  ScenarioFile& scenario_;
  ScenarioNames names_;
  std::vector<ObjectId> moved_by_;    ///< by hand, in the state being read
  std::vector<bool> hidden_;          ///< by object
  std::vector<std::uint32_t> group_;  ///< by object
};

}  // namespace tenon
