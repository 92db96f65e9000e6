#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon {

/// Reads one scenario file: objects, hands, pairs; then its states by a StateReader.
///
/// Threads: one. Real-time: no.
class ScenarioReader {
 public:
  explicit ScenarioReader(const std::filesystem::path& path);

  [[nodiscard]] Result<ScenarioFile> read(std::string_view text);

 private:
  void readScenario(const YAML::Node& root);
  void readObject(const YAML::Node& node);
  void readMeshes(const YAML::Node& node, ScenarioObject& object);
  void readBody(const YAML::Node& node, ScenarioObject& object);  // scenario_bodies.cpp
  void readStructures(const YAML::Node& node, ScenarioObject& object);
  void readHand(const YAML::Node& node);
  /// Every two objects that can ever touch, one pair each.
  void listPairs(const YAML::Node& states);
  void readPair(const YAML::Node& node);
  void readOff(const YAML::Node& node);
  [[nodiscard]] std::vector<bool> whoCanMove(const YAML::Node& states) const;
  [[nodiscard]] std::vector<bool> whoChangesGroup(const YAML::Node& states) const;
  void checkClearances();

  YamlReader yaml_;
  ScenarioFile scenario_;
  ScenarioNames names_;
};

}  // namespace tenon
