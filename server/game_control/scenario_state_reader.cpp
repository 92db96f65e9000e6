#include "server/game_control/scenario_state_reader.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

#include "server/game_control/condition_reader.h"
#include "server/game_control/text_limits.h"

namespace tenon::game_control {
namespace {

constexpr double kTouchSeconds = 1.0;  // [s] paper §5

}  // namespace

ScenarioStateReader::ScenarioStateReader(YamlReader& yaml, ScenarioFile& scenario,
                                         const std::vector<HandAssignment>& taken)
    : yaml_(yaml), scenario_(scenario), names_(yaml, scenario), taken_(taken) {
  for (const ScenarioHand& hand : scenario.hands) object_of_hand_.push_back(hand.object);
  for (const ScenarioObject& object : scenario.objects) {
    hidden_.push_back(object.status == ObjectStatus::kHidden);
    group_.push_back(object.group);
  }
  for (const HandAssignment& take : taken) hidden_[take.object.value] = false;
}

std::string ScenarioStateReader::describeKey(const ScenarioState& state, const std::string& key) const {
  return "'" + key + "' of state '" + state.name + "'";
}

void ScenarioStateReader::read(const YAML::Node& states) {
  if (!yaml_.checkList(states, "'states'", kMaxStates)) return;
  for (const auto& node : states) {
    ScenarioState state = readState(node);
    if (yaml_.failed()) return;
    const auto same = std::find_if(scenario_.states.begin(), scenario_.states.end(),
                                   [&](const ScenarioState& other) { return other.name == state.name; });
    if (same != scenario_.states.end()) {
      yaml_.fail(
          node, "two states are named '" + state.name + "', the first in line " + std::to_string(same->line));
      return;
    }
    if (state.snap) {
      for (std::size_t hand = 0; hand < object_of_hand_.size(); ++hand) {
        if (object_of_hand_[hand] == state.object) object_of_hand_[hand] = scenario_.hands[hand].object;
      }
    }
    scenario_.states.push_back(std::move(state));
  }
  if (scenario_.states.empty()) yaml_.fail(states, "'states' is empty, expected at least one state");
  checkGroups();
}

void ScenarioStateReader::addEndlessState() {
  ScenarioState state;
  state.name = "no states";
  state.title.push_back({scenario_.language, state.name});
  state.hand = firstCoupledHand();
  state.conditions.resize(2);
  state.conditions[1].kind = ConditionKind::kFulfilled;
  scenario_.states.push_back(std::move(state));
}

ScenarioState ScenarioStateReader::readState(const YAML::Node& node) {
  ScenarioState state;
  if (!yaml_.openMapping(node, "state", "a state")) return state;
  state.line = yaml_.lineOf(node);
  state.name = yaml_.text(node["name"], "'name' of a state", kMaxStateName);
  state.title = names_.texts(node["title"], describeKey(state, "title"), kMaxStateTitle);
  if (state.title.empty()) state.title.push_back({scenario_.language, state.name});
  state.instruction = names_.texts(node["instruction"], describeKey(state, "instruction"), kMaxInstruction);
  if (node["part"].IsDefined())
    state.part = yaml_.text(node["part"], describeKey(state, "part"), kMaxStateName);
  readEffects(node, state);
  readTask(node, state);
  readEnd(node, state);
  if (yaml_.failed()) return state;
  if (node["conditions"].IsDefined()) {
    state.conditions = ConditionReader(yaml_, names_, scenario_.signals, state).read(node["conditions"]);
  } else {
    useDefaultConditions(node, state);
  }
  if (!yaml_.failed()) checkFeasible(node, state);
  return state;
}

void ScenarioStateReader::readTask(const YAML::Node& node, ScenarioState& state) {
  if (node["touch"].IsDefined()) state.touch = names_.object(node["touch"], describeKey(state, "touch"));
  if (node["object"].IsDefined()) {
    state.object = names_.object(node["object"], describeKey(state, "object"));
  } else {
    state.object = state.touch;
  }
  if (node["hand"].IsDefined()) {
    state.hand = names_.hand(node["hand"], describeKey(state, "hand"));
  } else {
    state.hand = handMoving(state.object);
    if (!state.hand.valid()) state.hand = firstCoupledHand();
  }
  showTouchedObject(state);
  if (node["target"].IsDefined()) readTarget(node["target"], state);
  if (node["approach"].IsDefined()) readApproach(node["approach"], state);
}

void ScenarioStateReader::readTarget(const YAML::Node& node, ScenarioState& state) {
  const std::string what = describeKey(state, "target");
  if (!yaml_.openMapping(node, "target", what)) return;
  if (!node["at"].IsDefined()) yaml_.fail(node, what + " has no 'at', expected a position [x, y, z]");
  state.X_WG = yaml_.pose(node, what);
  state.tolerance = yaml_.numberOr(node["within"], Quantity::kLength, "'within' of " + what,
                                   kSmallestTolerance, 1.0, state.tolerance);
  state.angle_tolerance = yaml_.numberOr(node["angle"], Quantity::kAngle, "'angle' of " + what,
                                         kSmallestTolerance, std::numbers::pi, state.angle_tolerance);
}

void ScenarioStateReader::readApproach(const YAML::Node& node, ScenarioState& state) {
  const std::string what = describeKey(state, "approach");
  if (!yaml_.openMapping(node, "approach", what)) return;
  const Vector3 direction = yaml_.vector(node["direction"], Quantity::kPlain, "'direction' of " + what);
  state.approach_distance =
      yaml_.number(node["distance"], Quantity::kLength, "'distance' of " + what, 0.0, 10.0);
  if (direction.norm() < kSmallestTolerance) {
    yaml_.fail(node, "'direction' of " + what + " has length 0, expected a vector such as [0, 0, -1]");
    return;
  }
  state.approach_W = direction.normalized();
  if (!state.X_WG) yaml_.fail(node, what + " needs a 'target' in its state");
}

void ScenarioStateReader::readEnd(const YAML::Node& node, ScenarioState& state) {
  state.snap = yaml_.boolean(node["snap"], describeKey(state, "snap"), false);
  state.timeout = toTicks(yaml_.numberOr(node["timeout"], Quantity::kTime, describeKey(state, "timeout"),
                                         kTickSeconds, kLongestTime, 0.0));
  const YAML::Node action = node["on_timeout"];
  if (!action.IsDefined()) return;
  const std::string word = yaml_.text(action, describeKey(state, "on_timeout"));
  if (word != "fail" && word != "skip") {
    yaml_.fail(action, describeKey(state, "on_timeout") + " is '" + word + "', expected 'fail' or 'skip'");
  }
  if (!node["timeout"].IsDefined())
    yaml_.fail(action, "state '" + state.name + "' has 'on_timeout' but no 'timeout'");
  state.on_timeout = word == "skip" ? TimeoutAction::kSkip : TimeoutAction::kFail;
}

void ScenarioStateReader::showTouchedObject(ScenarioState& state) {
  if (!state.touch.valid() || !hidden_[state.touch.value]) return;
  state.placements.push_back({PlacementKind::kShow, state.touch, std::nullopt});
  hidden_[state.touch.value] = false;
}

void ScenarioStateReader::useDefaultConditions(const YAML::Node& node, ScenarioState& state) {
  Condition root;
  state.conditions.push_back(root);
  Condition leaf;
  if (state.touch.valid()) {
    leaf.kind = ConditionKind::kContact;
    leaf.object = object_of_hand_[state.hand.value];
    leaf.other = state.touch;
    leaf.limit_ticks = toTicks(yaml_.numberOr(node["for"], Quantity::kTime, describeKey(state, "for"), 0.0,
                                              kLongestTime, kTouchSeconds));
    leaf.lapse = toTicks(kContactLapse);
    if (leaf.object == leaf.other || scenario_.pairOf(leaf.object, leaf.other) < 0) {
      yaml_.fail(node["touch"], describeKey(state, "touch") + ": '" + names_.nameOf(leaf.object) + "' and '" +
                                    names_.nameOf(leaf.other) + "' never collide");
    }
  } else if (state.X_WG && state.object.valid()) {
    leaf.kind = ConditionKind::kPose;
    leaf.object = state.object;
    leaf.X_WG = *state.X_WG;
    leaf.within = state.tolerance;
    leaf.angle = state.angle_tolerance;
    leaf.dwell =
        toTicks(yaml_.numberOr(node["target"]["dwell"], Quantity::kTime,
                               "'dwell' of " + describeKey(state, "target"), 0.0, kLongestTime, kPoseDwell));
  } else {
    leaf.kind = ConditionKind::kFulfilled;
  }
  state.conditions.push_back(leaf);
}

void ScenarioStateReader::checkFeasible(const YAML::Node& node, const ScenarioState& state) {
  if (node["for"].IsDefined() && (!state.touch.valid() || node["conditions"].IsDefined())) {
    yaml_.fail(node["for"],
               describeKey(state, "for") + " belongs to a 'touch' without 'conditions' of its own");
  }
  if (node["conditions"].IsDefined() && node["target"].IsDefined() && node["target"]["dwell"].IsDefined()) {
    yaml_.fail(node["target"]["dwell"],
               "state '" + state.name + "' has 'conditions': write the 'dwell' there");
  }
  if (state.X_WG && !state.object.valid()) {
    yaml_.fail(node["target"], "state '" + state.name + "' has a target, but no 'object' to bring there");
  }
  if (state.snap && !state.X_WG) {
    yaml_.fail(node["snap"], "state '" + state.name + "' snaps" +
                                 (state.object.valid() ? " '" + names_.nameOf(state.object) + "'" : "") +
                                 ", but has no target pose");
  }
  if (state.X_WG && state.object.valid() && !handMoving(state.object).valid()) {
    yaml_.fail(node["target"], "the target of state '" + state.name + "' cannot be reached: no hand moves '" +
                                   names_.nameOf(state.object) +
                                   "', expected hands: {<hand>: " + names_.nameOf(state.object) + "}");
  }
  if (state.object.valid() && hidden_[state.object.value]) {
    yaml_.fail(node, "'" + names_.nameOf(state.object) + "' is hidden in state '" + state.name +
                         "', expected it in 'show'");
  }
  for (const Condition& condition : state.conditions) {
    const bool counts =
        condition.kind == ConditionKind::kContact || condition.kind == ConditionKind::kContactTime;
    if (condition.kind == ConditionKind::kContact && inSameGroup(condition.object, condition.other)) {
      yaml_.fail(node, "state '" + state.name + "' requires contact of '" + names_.nameOf(condition.object) +
                           "' and '" + names_.nameOf(condition.other) + "', but both are in group '" +
                           scenario_.groups[group_[condition.other.value] - 1] + "'");
    }
    const std::uint32_t needed_ticks =
        counts ? std::max(condition.limit_ticks, condition.dwell) : condition.dwell;
    if (state.timeout > 0 && needed_ticks > state.timeout) {
      yaml_.fail(node["timeout"], describeKey(state, "timeout") + " is shorter than its conditions require");
    }
  }
}

HandId ScenarioStateReader::firstCoupledHand() const {
  for (std::uint32_t hand = 0; hand < scenario_.hands.size(); ++hand) {
    const ScenarioHand& spec = scenario_.hands[hand];
    if (spec.role == Role::kTrainee && spec.kind == simulation::HandKind::kCoupled) return HandId{hand};
  }
  return HandId{0};
}

HandId ScenarioStateReader::handMoving(ObjectId object) const {
  if (object.valid()) {
    for (std::uint32_t hand = 0; hand < object_of_hand_.size(); ++hand) {
      if (object_of_hand_[hand] == object) return HandId{hand};
    }
    for (const HandAssignment& take : taken_)
      if (take.object == object) return take.hand;
  }
  return {};
}

}  // namespace tenon::game_control
