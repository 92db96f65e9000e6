#include <algorithm>

#include "server/game_control/scenario_reader.h"

namespace tenon::game_control {

std::vector<bool> ScenarioReader::movableObjects(const YAML::Node& states) const {
  std::vector<bool> movable(scenario_.objects.size(), false);
  for (std::size_t i = 0; i < movable.size(); ++i) {
    const ObjectStatus status = scenario_.objects[i].status;
    movable[i] =
        scenario_.objects[i].body || status == ObjectStatus::kHeld || status == ObjectStatus::kTracked;
  }
  for (const ScenarioHand& hand : scenario_.hands) movable[hand.object.value] = true;
  for (const HandAssignment& take : options_.taken) movable[take.object.value] = true;
  // objects that states give to hands or that have a target; errors are reported when the states are read
  const auto add = [&](const YAML::Node& name) {
    if (!name.IsDefined() || !name.IsScalar()) return;
    const ObjectId object = scenario_.objectNamed(name.Scalar());
    if (object.valid()) movable[object.value] = true;
  };
  if (!states.IsDefined() || !states.IsSequence()) return movable;
  for (const auto& state : states) {
    if (!state.IsMap()) continue;
    const YAML::Node hands = state["hands"];
    if (hands.IsDefined() && hands.IsMap()) {
      for (const auto& entry : hands) add(entry.second);
    }
    if (state["target"].IsDefined()) add(state["object"]);
  }
  return movable;
}

std::vector<bool> ScenarioReader::regroupedObjects(const YAML::Node& states) const {
  std::vector<bool> regrouped(scenario_.objects.size(), false);
  if (!states.IsDefined() || !states.IsSequence()) return regrouped;
  for (const auto& state : states) {
    if (!state.IsMap() || !state["groups"].IsDefined() || !state["groups"].IsMap()) continue;
    for (const auto& entry : state["groups"]) {
      if (!entry.first.IsScalar()) continue;
      const ObjectId object = scenario_.objectNamed(entry.first.Scalar());
      if (object.valid()) regrouped[object.value] = true;
    }
  }
  return regrouped;
}

void ScenarioReader::listPairs(const YAML::Node& states) {
  const std::vector<bool> movable = movableObjects(states);
  const std::vector<bool> regrouped = regroupedObjects(states);
  const auto isTracked = [&](std::uint32_t object) {
    return scenario_.objects[object].status == ObjectStatus::kTracked ||
           std::any_of(scenario_.hands.begin(), scenario_.hands.end(), [&](const ScenarioHand& hand) {
             return hand.kind == simulation::HandKind::kTracked && hand.object.value == object;
           });
  };
  const auto count = static_cast<std::uint32_t>(scenario_.objects.size());
  for (std::uint32_t a = 0; a < count; ++a) {
    for (std::uint32_t b = a + 1; b < count; ++b) {
      const ScenarioObject& first = scenario_.objects[a];
      const ScenarioObject& second = scenario_.objects[b];
      const bool always_grouped =
          first.group != 0 && first.group == second.group && !regrouped[a] && !regrouped[b];
      if (always_grouped || !first.collidable || !second.collidable || !(movable[a] || movable[b])) continue;
      ScenarioPair pair;
      pair.a = ObjectId{a};
      pair.b = ObjectId{b};
      pair.sensing = isTracked(a) || isTracked(b);
      scenario_.pairs.push_back(pair);
    }
  }
}

void ScenarioReader::readPair(const YAML::Node& node) {
  if (yaml_.failed() || !yaml_.openMapping(node, "pair", "a pair")) return;
  const auto index = names_.pair(node["between"], "'between' of a pair");
  if (!index) return;
  ScenarioPair& pair = scenario_.pairs[*index];
  const std::string of = " of pair " + names_.nameOf(pair.a) + "-" + names_.nameOf(pair.b);
  if (pair.line != 0) {
    yaml_.fail(node, "pair " + names_.nameOf(pair.a) + "-" + names_.nameOf(pair.b) +
                         " is listed twice, first in line " + std::to_string(pair.line));
    return;
  }
  pair.line = yaml_.lineOf(node);
  pair.clearance = yaml_.numberOr(node["clearance"], Quantity::kLength, "'clearance'" + of, 1e-6, 1.0, 0.0);
  pair.sensing = yaml_.boolean(node["sensing"], "'sensing'" + of, pair.sensing);
  pair.enabled = yaml_.boolean(node["enabled"], "'enabled'" + of, true);
  if (node["friction"].IsDefined()) {
    const double at_rest = yaml_.number(node["friction"], Quantity::kPlain, "'friction'" + of, 0.0, 2.0);
    const double sliding = yaml_.numberOr(node["sliding_friction"], Quantity::kPlain,
                                          "'sliding_friction'" + of, 0.0, at_rest, at_rest);
    pair.friction = collision::Friction{at_rest, sliding};
  } else if (node["sliding_friction"].IsDefined()) {
    yaml_.fail(node["sliding_friction"], "'sliding_friction'" + of + " needs 'friction' with it");
  }
}

void ScenarioReader::readDisabledPair(const YAML::Node& node) {
  if (yaml_.failed()) return;
  // [drill, any]: all pairs of one object
  if (node.IsSequence() && node.size() == 2 && node[1].IsScalar() && node[1].Scalar() == "any") {
    const ObjectId object = names_.object(node[0], "'pairs_off'");
    for (ScenarioPair& pair : scenario_.pairs) {
      if (pair.a == object || pair.b == object) pair.enabled = false;
    }
  } else if (const auto pair = names_.pair(node, "'pairs_off'")) {
    scenario_.pairs[*pair].enabled = false;
  }
}

}  // namespace tenon::game_control
