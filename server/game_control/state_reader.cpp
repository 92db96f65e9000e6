#include "server/game_control/state_reader.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

#include "server/game_control/condition_reader.h"

namespace tenon {
namespace {

constexpr double kTouchSeconds = 1.0;  // paper §5
constexpr std::size_t kMostStates = 1000;

}  // namespace

StateReader::StateReader(YamlReader& yaml, ScenarioFile& scenario)
    : yaml_(yaml), scenario_(scenario), names_(yaml, scenario) {
  for (const ScenarioHand& hand : scenario.hands) moved_by_.push_back(hand.object);
  for (const ScenarioObject& object : scenario.objects)
    hidden_.push_back(object.status == ObjectStatus::kHidden);
}

std::string StateReader::in(const ScenarioState& state, const std::string& key) const {
  return "'" + key + "' of state '" + state.name + "'";
}

void StateReader::read(const YAML::Node& states) {
  if (!yaml_.isList(states, "'states'", kMostStates)) return;
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
      for (std::size_t hand = 0; hand < moved_by_.size(); ++hand) {
        if (moved_by_[hand] == state.object) moved_by_[hand] = scenario_.hands[hand].object;
      }
    }
    scenario_.states.push_back(std::move(state));
  }
  if (scenario_.states.empty()) yaml_.fail(states, "'states' is empty, expected at least one state");
}

ScenarioState StateReader::readState(const YAML::Node& node) {
  ScenarioState state;
  if (!yaml_.openMapping(node, "state", "a state")) return state;
  state.line = yaml_.lineOf(node);
  state.name = yaml_.text(node["name"], "'name' of a state");
  state.title = names_.texts(node["title"], in(state, "title"));
  if (state.title.empty()) state.title.push_back({scenario_.language, state.name});
  state.instruction = names_.texts(node["instruction"], in(state, "instruction"));
  if (node["part"].IsDefined()) state.part = yaml_.text(node["part"], in(state, "part"));
  readEffects(node, state);
  readTask(node, state);
  readEnd(node, state);
  if (yaml_.failed()) return state;
  if (node["conditions"].IsDefined()) {
    state.conditions = ConditionReader(yaml_, names_, scenario_.signals, state).read(node["conditions"]);
  } else {
    useDefaultConditions(node, state);
  }
  if (!yaml_.failed()) checkDoable(node, state);
  return state;
}

void StateReader::readEffects(const YAML::Node& node, ScenarioState& state) {
  for (const std::string key : {"pairs_on", "pairs_off"}) {
    const YAML::Node list = node[key];
    if (!list.IsDefined() || !yaml_.isList(list, in(state, key))) continue;
    for (const auto& entry : list) {
      const auto pair = names_.pair(entry, in(state, key));
      if (pair) state.pairs.push_back({*pair, key == "pairs_on"});
    }
  }
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

void StateReader::readPlacements(const YAML::Node& node, const std::string& key, PlacementKind kind,
                                 ScenarioState& state) {
  const YAML::Node given = node[key];
  if (!given.IsDefined()) return;
  const std::string what = in(state, key);
  const auto place = [&](const YAML::Node& name, std::optional<Pose> X_WO) {
    const ObjectId object = names_.object(name, what);
    if (!object.valid()) return;
    if (X_WO && X_WO->translation().norm() > scenario_.reach)
      yaml_.fail(name, what + " is outside the scene");
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
  } else if (yaml_.isList(given, what)) {
    for (const auto& name : given) place(name, std::nullopt);
  }
}

void StateReader::readHands(const YAML::Node& node, ScenarioState& state) {
  if (!node.IsDefined()) return;
  const std::string what = in(state, "hands");
  if (!node.IsMap()) {
    yaml_.fail(node, what + " must be a mapping from hand to object, such as {right: peg}");
    return;
  }
  for (const auto& entry : node) {
    const HandId hand = names_.hand(entry.first, what);
    const ObjectId object = names_.object(entry.second, what);
    if (!hand.valid() || !object.valid() || !mayTake(entry, hand, object, what)) return;
    moved_by_[hand.value] = object;
    state.hands.push_back({hand, object});
  }
}

/// A hand that the file lets take an object has to be one that can, and the object nobody else's own.
bool StateReader::mayTake(const YAML::detail::iterator_value& entry, HandId hand, ObjectId object,
                          const std::string& what) {
  if (scenario_.hands[hand.value].kind == HandKind::kTracked) {
    yaml_.fail(entry.first,
               what + ": '" + scenario_.hands[hand.value].name + "' is tracked, it can take nothing");
    return false;
  }
  for (std::size_t other = 0; other < scenario_.hands.size(); ++other) {
    if (other != hand.value && scenario_.hands[other].object == object) {
      yaml_.fail(entry.second, what + ": '" + names_.nameOf(object) + "' belongs to hand '" +
                                   scenario_.hands[other].name + "'");
      return false;
    }
  }
  return true;
}

void StateReader::readHelpers(const YAML::Node& node, ScenarioState& state) {
  if (!node.IsDefined()) return;
  const std::string what = in(state, "may_take");
  if (!node.IsMap() || node.size() > kMostHelpers) {
    yaml_.fail(node, what + " must be a mapping from hand to object, such as {left: peg}, of at most " +
                         std::to_string(kMostHelpers));
    return;
  }
  for (const auto& entry : node) {
    const HandId hand = names_.hand(entry.first, what);
    const ObjectId object = names_.object(entry.second, what);
    if (!hand.valid() || !object.valid() || !mayTake(entry, hand, object, what)) return;
    const ScenarioHand& helper = scenario_.hands[hand.value];
    if (moved_by_[hand.value] == object) {
      yaml_.fail(entry.first, what + ": '" + helper.name + "' moves '" + names_.nameOf(object) + "' already");
    } else if (scenario_.pairOf(helper.object, object) < 0) {
      yaml_.fail(entry.second, what + ": '" + names_.nameOf(helper.object) + "' and '" +
                                   names_.nameOf(object) + "' never touch");
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

void StateReader::readTask(const YAML::Node& node, ScenarioState& state) {
  if (node["touch"].IsDefined()) state.touch = names_.object(node["touch"], in(state, "touch"));
  if (node["object"].IsDefined()) {
    state.object = names_.object(node["object"], in(state, "object"));
  } else {
    state.object = state.touch;
  }
  if (node["hand"].IsDefined()) {
    state.hand = names_.hand(node["hand"], in(state, "hand"));
  } else {
    state.hand = handMoving(state.object);
    if (!state.hand.valid()) state.hand = firstHand();
  }
  appearWhatIsTouched(state);
  if (node["target"].IsDefined()) readTarget(node["target"], state);
  if (node["approach"].IsDefined()) readApproach(node["approach"], state);
}

void StateReader::readTarget(const YAML::Node& node, ScenarioState& state) {
  const std::string what = in(state, "target");
  if (!yaml_.openMapping(node, "target", what)) return;
  if (!node["at"].IsDefined()) yaml_.fail(node, what + " has no 'at', expected a position [x, y, z]");
  state.X_WG = yaml_.pose(node, what);
  state.tolerance = yaml_.numberOr(node["within"], Quantity::kLength, "'within' of " + what,
                                   kSmallestTolerance, 1.0, state.tolerance);
  state.angle_tolerance = yaml_.numberOr(node["angle"], Quantity::kAngle, "'angle' of " + what,
                                         kSmallestTolerance, std::numbers::pi, state.angle_tolerance);
  const double distance = state.X_WG->translation().norm();
  if (distance > scenario_.reach) {
    yaml_.fail(node, "the target of state '" + state.name + "' is " + std::to_string(distance) +
                         " m from the world's origin, the scene ends at " + std::to_string(scenario_.reach) +
                         " m ('reach')");
  }
}

void StateReader::readApproach(const YAML::Node& node, ScenarioState& state) {
  const std::string what = in(state, "approach");
  if (!yaml_.openMapping(node, "approach", what)) return;
  const Vector3 direction = yaml_.vector(node["direction"], Quantity::kPlain, "'direction' of " + what);
  state.approach_distance =
      yaml_.number(node["distance"], Quantity::kLength, "'distance' of " + what, 0.0, 10.0);
  if (direction.norm() < kSmallestTolerance) {
    yaml_.fail(node, "'direction' of " + what + " has no length, expected one such as [0, 0, -1]");
    return;
  }
  state.approach_W = direction.normalized();
  if (!state.X_WG) yaml_.fail(node, what + " leads nowhere: the state has no target");
}

void StateReader::readEnd(const YAML::Node& node, ScenarioState& state) {
  state.snap = yaml_.yesNo(node["snap"], in(state, "snap"), false);
  state.timeout = toTicks(yaml_.numberOr(node["timeout"], Quantity::kTime, in(state, "timeout"), kTickSeconds,
                                         kLongestTime, 0.0));
  const YAML::Node action = node["on_timeout"];
  if (!action.IsDefined()) return;
  const std::string word = yaml_.text(action, in(state, "on_timeout"));
  if (word != "fail" && word != "skip") {
    yaml_.fail(action, in(state, "on_timeout") + " is '" + word + "', expected 'fail' or 'skip'");
  }
  if (!node["timeout"].IsDefined())
    yaml_.fail(action, "state '" + state.name + "' has 'on_timeout' but no 'timeout'");
  state.on_timeout = word == "skip" ? TimeoutAction::kSkip : TimeoutAction::kFail;
}

void StateReader::appearWhatIsTouched(ScenarioState& state) {
  if (!state.touch.valid() || !hidden_[state.touch.value]) return;
  state.placements.push_back({PlacementKind::kShow, state.touch, std::nullopt});
  hidden_[state.touch.value] = false;
}

void StateReader::useDefaultConditions(const YAML::Node& node, ScenarioState& state) {
  Condition root;
  state.conditions.push_back(root);
  Condition leaf;
  if (state.touch.valid()) {
    leaf.kind = ConditionKind::kContact;
    leaf.object = moved_by_[state.hand.value];
    leaf.other = state.touch;
    leaf.limit_ticks = toTicks(
        yaml_.numberOr(node["for"], Quantity::kTime, in(state, "for"), 0.0, kLongestTime, kTouchSeconds));
    leaf.lapse = toTicks(kContactLapse);
    if (leaf.object == leaf.other || scenario_.pairOf(leaf.object, leaf.other) < 0) {
      yaml_.fail(node["touch"], in(state, "touch") + ": '" + names_.nameOf(leaf.object) + "' and '" +
                                    names_.nameOf(leaf.other) + "' never touch");
    }
  } else if (state.X_WG && state.object.valid()) {
    leaf.kind = ConditionKind::kPose;
    leaf.object = state.object;
    leaf.X_WG = *state.X_WG;
    leaf.within = state.tolerance;
    leaf.angle = state.angle_tolerance;
    leaf.dwell = toTicks(yaml_.numberOr(node["target"]["dwell"], Quantity::kTime,
                                        "'dwell' of " + in(state, "target"), 0.0, kLongestTime, kPoseDwell));
  } else {
    leaf.kind = ConditionKind::kFulfilled;
  }
  state.conditions.push_back(leaf);
}

void StateReader::checkDoable(const YAML::Node& node, const ScenarioState& state) {
  if (node["for"].IsDefined() && (!state.touch.valid() || node["conditions"].IsDefined())) {
    yaml_.fail(node["for"], in(state, "for") + " belongs to a 'touch' without 'conditions' of its own");
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
    yaml_.fail(node["target"], "the target of state '" + state.name + "' is out of reach: nobody moves '" +
                                   names_.nameOf(state.object) +
                                   "', expected hands: {<hand>: " + names_.nameOf(state.object) + "}");
  }
  if (state.object.valid() && hidden_[state.object.value]) {
    yaml_.fail(node, "'" + names_.nameOf(state.object) + "' is still hidden in state '" + state.name +
                         "', expected it in 'show'");
  }
  for (const Condition& condition : state.conditions) {
    const bool counts =
        condition.kind == ConditionKind::kContact || condition.kind == ConditionKind::kContactTime;
    const std::uint32_t needed = counts ? std::max(condition.limit_ticks, condition.dwell) : condition.dwell;
    if (state.timeout > 0 && needed > state.timeout) {
      yaml_.fail(node["timeout"], in(state, "timeout") + " is shorter than what its conditions ask for");
    }
  }
}

HandId StateReader::firstHand() const {
  for (std::uint32_t hand = 0; hand < scenario_.hands.size(); ++hand) {
    const ScenarioHand& spec = scenario_.hands[hand];
    if (spec.role == Role::kTrainee && spec.kind == HandKind::kCoupled) return HandId{hand};
  }
  return HandId{0};
}

HandId StateReader::handMoving(ObjectId object) const {
  if (object.valid()) {
    for (std::uint32_t hand = 0; hand < moved_by_.size(); ++hand) {
      if (moved_by_[hand] == object) return HandId{hand};
    }
  }
  return {};
}

}  // namespace tenon
