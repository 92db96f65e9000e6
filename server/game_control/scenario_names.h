#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "server/game_control/scenario.h"
#include "server/game_control/yaml_reader.h"

namespace tenon {

/// Turns names in a scenario file into ids, and says which name was probably meant when there is no such
/// thing.
///
/// Threads: one. Real-time: no.
class ScenarioNames {
 public:
  ScenarioNames(YamlReader& yaml, ScenarioFile& scenario) : yaml_(yaml), scenario_(scenario) {}

  /// Invalid after a failure; `what` names the place: "'touch' of state 'take'".
  [[nodiscard]] ObjectId object(const YAML::Node& node, const std::string& what) const;
  [[nodiscard]] HandId hand(const YAML::Node& node, const std::string& what) const;
  /// Of a list of two names.
  [[nodiscard]] std::optional<std::pair<ObjectId, ObjectId>> twoObjects(const YAML::Node& node,
                                                                        const std::string& what) const;
  /// Of a list of two names that are checked against each other.
  [[nodiscard]] std::optional<std::uint32_t> pair(const YAML::Node& node, const std::string& what) const;
  /// Number of a group; a new name makes one. 0: `none`.
  [[nodiscard]] std::uint32_t group(const YAML::Node& node, const std::string& what) const;
  /// A text, or a mapping from language to text that has the scenario's main language.
  [[nodiscard]] Texts texts(const YAML::Node& node, const std::string& what) const;

  [[nodiscard]] const std::string& nameOf(ObjectId object) const {
    return scenario_.objects[object.value].name;
  }

 private:
  YamlReader& yaml_;
  ScenarioFile& scenario_;
};

}  // namespace tenon
