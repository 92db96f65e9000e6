#pragma once

#include <string>
#include <vector>

#include "server/game_control/scenario.h"
#include "server/game_control/scenario_names.h"
#include "server/game_control/yaml_reader.h"

namespace tenon {

/// Reads the condition tree of one state; what a leaf leaves out is the state's own (object, target,
/// tolerances).
///
/// Threads: one. Real-time: no.
class ConditionReader {
 public:
  ConditionReader(YamlReader& yaml, const ScenarioNames& names, std::vector<std::string>& signals,
                  const ScenarioState& state)
      : yaml_(yaml), names_(names), signals_(signals), state_(state) {}

  /// A condition, or a list of them that must all be met.
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
  [[nodiscard]] ObjectId objectOr(const YAML::Node& node, const std::string& what);
  [[nodiscard]] std::uint32_t ticks(const YAML::Node& node, const std::string& what, double when_missing);

  YamlReader& yaml_;
  const ScenarioNames& names_;
  std::vector<std::string>& signals_;
  const ScenarioState& state_;
  std::vector<Condition> tree_;
};

/// A time of a scenario in whole ticks.
[[nodiscard]] std::uint32_t toTicks(double seconds);

inline constexpr double kLongestTime = 86'400.0;    ///< [s] a day: any time of a scenario
inline constexpr double kSmallestTolerance = 1e-6;  ///< [m], [rad], [N]: below, nothing could ever be met
inline constexpr double kContactLapse = 0.05;       ///< [s] a trembling hand may lose contact for
inline constexpr double kPoseDwell = 0.2;  ///< [s] a part rests at its target before it counts as mounted

}  // namespace tenon
