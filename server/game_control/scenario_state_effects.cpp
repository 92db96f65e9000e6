#include <algorithm>
#include <optional>
#include <string_view>

#include "idl/types/messages/contacts.h"
#include "server/game_control/scenario_keys.h"
#include "server/game_control/scenario_state_reader.h"

namespace tenon::game_control {
namespace {

std::string hintForGroup(const std::vector<std::string>& groups, const std::string& name) {
  std::vector<std::string_view> others;
  for (const std::string& group : groups) {
    if (group != name) others.push_back(group);
  }
  const std::string hint = suggestion(name, others);
  return hint.empty() ? "" : "; " + hint;
}

}  // namespace

void ScenarioStateReader::readEffects(const YAML::Node& node, ScenarioState& state) {
  for (const std::string key : {"pairs_on", "pairs_off"}) {
    const YAML::Node list = node[key];
    if (!list.IsDefined() || !yaml_.checkList(list, describeKey(state, key))) continue;
    for (const auto& entry : list) {
      const auto pair = names_.pair(entry, describeKey(state, key));
      if (pair) state.pairs.push_back({*pair, key == "pairs_on"});
    }
  }
  readGroups(node["groups"], state);
  readPlacements(node, "show", PlacementKind::kShow, state);
  readPlacements(node, "place", PlacementKind::kShow, state);
  readPlacements(node, "fix", PlacementKind::kFix, state);
  readPlacements(node, "free", PlacementKind::kFree, state);
  readPlacements(node, "hide", PlacementKind::kHide, state);
  for (const Placement& placement : state.placements) {
    hidden_[placement.object.value] = placement.kind == PlacementKind::kHide;
  }
  readHands(node["hands"], state);
  readHelpers(node["may_take"], state);
}

void ScenarioStateReader::readGroups(const YAML::Node& node, ScenarioState& state) {
  if (!node.IsDefined()) return;
  const std::string what = describeKey(state, "groups");
  if (!node.IsMap()) {
    yaml_.fail(node, what + " must be a mapping from object to group, such as {peg: car}, or {peg: none}");
    return;
  }
  for (const auto& entry : node) {
    const ObjectId object = names_.object(entry.first, what);
    if (!object.valid()) return;
    const bool twice = std::any_of(state.groups.begin(), state.groups.end(),
                                   [object](const GroupChange& other) { return other.object == object; });
    if (twice) yaml_.fail(entry.first, what + " names '" + names_.nameOf(object) + "' twice");
    group_[object.value] = names_.group(entry.second, what + ", object '" + names_.nameOf(object) + "',");
    state.groups.push_back({object, group_[object.value], yaml_.lineOf(entry.second)});
  }
}

bool ScenarioStateReader::inSameGroup(ObjectId a, ObjectId b) const {
  return group_[a.value] != 0 && group_[a.value] == group_[b.value];
}

/// A group that has only one member in all states has no effect: an error, most likely a misspelt name.
void ScenarioStateReader::checkGroups() {
  const auto isIn = [&](std::uint32_t object, std::uint32_t group) {
    const auto joins = [&](const ScenarioState& state) {
      return std::any_of(state.groups.begin(), state.groups.end(), [&](const GroupChange& change) {
        return change.object.value == object && change.group == group;
      });
    };
    return scenario_.objects[object].group == group ||
           std::any_of(scenario_.states.begin(), scenario_.states.end(), joins);
  };
  for (const ScenarioState& state : scenario_.states) {
    for (const GroupChange& change : state.groups) {
      bool alone = change.group != 0;
      for (std::uint32_t i = 0; i < scenario_.objects.size(); ++i) {
        alone = alone && (change.object.value == i || !isIn(i, change.group));
      }
      if (!alone) continue;
      const std::string& name = scenario_.groups[change.group - 1];
      const std::string hint = hintForGroup(scenario_.groups, name);
      yaml_.failAt(change.line, describeKey(state, "groups") + " puts '" + names_.nameOf(change.object) +
                                    "' into '" + name + "', which no other object is ever in" + hint);
    }
  }
}

void ScenarioStateReader::readPlacements(const YAML::Node& node, const std::string& key, PlacementKind kind,
                                         ScenarioState& state) {
  const YAML::Node given = node[key];
  if (!given.IsDefined()) return;
  const std::string what = describeKey(state, key);
  const auto place = [&](const YAML::Node& name, std::optional<Pose> X_WO) {
    const ObjectId object = names_.object(name, what);
    if (!object.valid()) return;
    const auto same = std::find_if(state.placements.begin(), state.placements.end(),
                                   [&](const Placement& other) { return other.object == object; });
    if (same != state.placements.end()) {
      yaml_.fail(name, "state '" + state.name + "' places '" + names_.nameOf(object) + "' twice");
    }
    state.placements.push_back({kind, object, X_WO});
  };
  // a mapping gives poses, a list leaves the objects where they are
  if (given.IsMap() && (key == "place" || key == "fix")) {
    for (const auto& entry : given) {
      if (!yaml_.openMapping(entry.second, "pose", what)) return;
      place(entry.first, yaml_.pose(entry.second, what));
    }
  } else if (key == "place") {
    yaml_.fail(given, what + " must be a mapping from object to pose, such as {peg: {at: [0, 0, 0.1]}}");
  } else if (yaml_.checkList(given, what)) {
    for (const auto& name : given) place(name, std::nullopt);
  }
}

void ScenarioStateReader::readHands(const YAML::Node& node, ScenarioState& state) {
  if (!node.IsDefined()) return;
  const std::string what = describeKey(state, "hands");
  if (!node.IsMap()) {
    yaml_.fail(node, what + " must be a mapping from hand to object, such as {right: peg}");
    return;
  }
  for (const auto& entry : node) {
    const HandId hand = names_.hand(entry.first, what);
    const ObjectId object = names_.object(entry.second, what);
    if (!hand.valid() || !object.valid() || !checkGrab(entry, hand, object, what)) return;
    object_of_hand_[hand.value] = object;
    state.hands.push_back({hand, object});
  }
}

/// A hand that grabs an object must be coupled, and the object must not be the default object of another
/// hand.
bool ScenarioStateReader::checkGrab(const YAML::detail::iterator_value& entry, HandId hand, ObjectId object,
                                    const std::string& what) {
  if (scenario_.hands[hand.value].kind == simulation::HandKind::kTracked) {
    yaml_.fail(entry.first,
               what + ": '" + scenario_.hands[hand.value].name + "' is tracked, it cannot grab an object");
    return false;
  }
  for (std::size_t other = 0; other < scenario_.hands.size(); ++other) {
    if (other != hand.value && scenario_.hands[other].object == object) {
      yaml_.fail(entry.second, what + ": '" + names_.nameOf(object) + "' is the default object of hand '" +
                                   scenario_.hands[other].name + "'");
      return false;
    }
  }
  return true;
}

void ScenarioStateReader::readHelpers(const YAML::Node& node, ScenarioState& state) {
  if (!node.IsDefined()) return;
  const std::string what = describeKey(state, "may_take");
  if (!node.IsMap() || node.size() > kMaxHelpers) {
    yaml_.fail(node, what + " must be a mapping from hand to object, such as {left: peg}, of at most " +
                         std::to_string(kMaxHelpers));
    return;
  }
  for (const auto& entry : node) {
    const HandId hand = names_.hand(entry.first, what);
    const ObjectId object = names_.object(entry.second, what);
    if (!hand.valid() || !object.valid() || !checkGrab(entry, hand, object, what)) return;
    const ScenarioHand& helper = scenario_.hands[hand.value];
    if (object_of_hand_[hand.value] == object) {
      yaml_.fail(entry.first, what + ": '" + helper.name + "' moves '" + names_.nameOf(object) + "' already");
    } else if (scenario_.pairOf(helper.object, object) < 0 || inSameGroup(helper.object, object)) {
      yaml_.fail(entry.second, what + ": '" + names_.nameOf(helper.object) + "' and '" +
                                   names_.nameOf(object) + "' never collide");
    }
    state.may_take.push_back({hand, object});
    const auto helpers = std::count_if(state.may_take.begin(), state.may_take.end(),
                                       [object](const auto& one) { return one.object == object; });
    if (helpers > kOtherPulls) {
      yaml_.fail(entry.second, what + ": '" + names_.nameOf(object) + "' can have " +
                                   std::to_string(kOtherPulls) + " helpers at most");
    }
  }
}

}  // namespace tenon::game_control
