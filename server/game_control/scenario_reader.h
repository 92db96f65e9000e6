#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon::game_control {

/// Reads one scenario file: objects, hands and pairs; the states are read by a ScenarioStateReader.
///
/// Threads: one. Real-time: no.
class ScenarioReader {
 public:
  /// `path` names the file in errors; mesh files are relative to its folder. It is not opened.
  ScenarioReader(const std::filesystem::path& path, const ReadOptions& options);

  /// Fails with the first error, `file:line: what was wrong, what was expected`. May be called once.
  [[nodiscard]] Result<ScenarioFile> read(std::string_view text);

 private:
  void readScenario(const YAML::Node& root);
  void readObject(const YAML::Node& node);
  void readMeshes(const YAML::Node& node, ScenarioObject& object);  // scenario_meshes.cpp
  [[nodiscard]] MeshSource readMesh(const YAML::Node& node, const std::string& object);  // likewise
  [[nodiscard]] Shape readShape(const YAML::Node& node, const std::string& object);      // likewise
  void readBody(const YAML::Node& node, ScenarioObject& object);  // scenario_bodies.cpp
  void readStructures(const YAML::Node& node, ScenarioObject& object);
  void readHand(const YAML::Node& node);
  /// Lists every pair of objects that can ever collide, once.
  void listPairs(const YAML::Node& states);
  void readPair(const YAML::Node& node);
  void readDisabledPair(const YAML::Node& node);
  /// By object: it is dynamic, tracked or held, or a hand moves it at the start or in a state.
  [[nodiscard]] std::vector<bool> movableObjects(const YAML::Node& states) const;
  /// By object: a state puts it into another group.
  [[nodiscard]] std::vector<bool> regroupedObjects(const YAML::Node& states) const;

  YamlReader yaml_;
  ReadOptions options_;
  ScenarioFile scenario_;
  ScenarioNames names_;
};

}  // namespace tenon::game_control
