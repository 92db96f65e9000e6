#pragma once

#include <string>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon::game_control {

/// Reads the condition tree of one state. An object, target or tolerance that a leaf omits is the state's.
/// Errors go to the YamlReader.
///
/// Threads: one. Real-time: no.
class ConditionReader {
 public:
  /// `signals` receives the names of signals that are new to the scenario.
  ConditionReader(YamlReader& yaml, const ScenarioNames& names, std::vector<std::string>& signals,
                  const ScenarioState& state)
      : yaml_(yaml), names_(names), signals_(signals), state_(state) {}

  /// A condition, or a list of conditions that must all be met.
  [[nodiscard]] std::vector<Condition> read(const YAML::Node& node);

 private:
  void add(const YAML::Node& node, std::uint32_t parent, int depth);
  void addGroup(const YAML::Node& node, const YAML::Node& children, Condition condition, int depth);
  void readPose(const YAML::Node& node, Condition& condition);
  void readForce(const YAML::Node& node, Condition& condition);
  void readContact(const YAML::Node& node, Condition& condition);
  void readContactTime(const YAML::Node& node, Condition& condition);
  void readCommand(const YAML::Node& node, Condition& condition);
  void readSignal(const YAML::Node& node, Condition& condition);
  /// The named object; that of the state when the key is missing.
  [[nodiscard]] ObjectId objectOrDefault(const YAML::Node& node, const std::string& what);
  /// A time in ticks; `default_value` [s] when the key is missing.
  [[nodiscard]] std::uint32_t readTicks(const YAML::Node& node, const std::string& what,
                                        double default_value);

  YamlReader& yaml_;
  const ScenarioNames& names_;
  std::vector<std::string>& signals_;
  const ScenarioState& state_;
  std::vector<Condition> tree_;
};

/// `seconds` [s], at least 0, rounded to whole ticks.
[[nodiscard]] std::uint32_t toTicks(double seconds);

inline constexpr double kLongestTime = 86'400.0;    ///< [s] largest time a scenario may give: a day
inline constexpr double kSmallestTolerance = 1e-6;  ///< [m], [rad], [N] smaller ones could never be met
inline constexpr double kContactLapse = 0.05;       ///< [s] tolerated interruption of a contact: hand tremor
inline constexpr double kPoseDwell = 0.2;  ///< [s] default dwell at a target before a part counts as mounted

}  // namespace tenon::game_control
