#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "server/game_control/scenario.h"
#include "server/game_control/yaml_reader.h"

namespace tenon::game_control {

/// Resolves names in a scenario file to ids. For an unknown name the error suggests the nearest known one.
///
/// `what` describes the value in errors: "'touch' of state 'take'".
///
/// Threads: one. Real-time: no.
class ScenarioNames {
 public:
  ScenarioNames(YamlReader& yaml, ScenarioFile& scenario) : yaml_(yaml), scenario_(scenario) {}

  /// Invalid after a failure.
  [[nodiscard]] ObjectId object(const YAML::Node& node, const std::string& what) const;
  [[nodiscard]] HandId hand(const YAML::Node& node, const std::string& what) const;
  /// From a list of two different names; empty after a failure.
  [[nodiscard]] std::optional<std::pair<ObjectId, ObjectId>> twoObjects(const YAML::Node& node,
                                                                        const std::string& what) const;
  /// Index into ScenarioFile::pairs, from a list of two names; empty after a failure.
  [[nodiscard]] std::optional<std::uint32_t> pair(const YAML::Node& node, const std::string& what) const;
  /// Number of a group; a new name adds a group. 0: `none`.
  [[nodiscard]] std::uint32_t group(const YAML::Node& node, const std::string& what) const;
  /// A text, or a mapping from language to text that includes the scenario's main language; each has at most
  /// `most` bytes.
  [[nodiscard]] Texts texts(const YAML::Node& node, const std::string& what, std::size_t most) const;

  [[nodiscard]] const std::string& nameOf(ObjectId object) const {
    return scenario_.objects[object.value].name;
  }

 private:
  YamlReader& yaml_;
  ScenarioFile& scenario_;
};

}  // namespace tenon::game_control
