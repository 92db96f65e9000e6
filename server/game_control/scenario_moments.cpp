#include "server/game_control/scenario_moments.h"

#include <algorithm>

namespace tenon::game_control {
namespace {

SceneMoment startOf(const ScenarioFile& scenario) {
  SceneMoment moment;
  for (const ScenarioObject& object : scenario.objects) {
    moment.X_WO.push_back(object.X_WO);
    moment.shown.push_back(object.status != ObjectStatus::kHidden);
    moment.group.push_back(object.group);
  }
  for (const ScenarioPair& pair : scenario.pairs) moment.pair_enabled.push_back(pair.enabled);
  moment.own_object.assign(scenario.objects.size(), false);
  for (const ScenarioHand& hand : scenario.hands) {
    moment.hand_objects.push_back(hand.object);
    moment.own_object[hand.object.value] = true;
    moment.shown[hand.object.value] = true;
  }
  return moment;
}

/// A hand's own object is hidden while the hand moves another one.
void assign(const ScenarioFile& scenario, HandId hand, ObjectId object, SceneMoment& moment) {
  const ObjectId own = scenario.hands[hand.value].object;
  moment.hand_objects[hand.value] = object;
  moment.shown[own.value] = object == own;
  moment.shown[object.value] = true;
}

void release(const ScenarioFile& scenario, ObjectId object, SceneMoment& moment) {
  for (std::uint32_t hand = 0; hand < scenario.hands.size(); ++hand)
    if (moment.hand_objects[hand] == object)
      assign(scenario, HandId{hand}, scenario.hands[hand].object, moment);
}

void begin(const ScenarioFile& scenario, const ScenarioState& state, SceneMoment& moment) {
  for (const PairSwitch& change : state.pairs) moment.pair_enabled[change.pair] = change.enabled;
  for (const GroupChange& change : state.groups) moment.group[change.object.value] = change.group;
  for (const Placement& placement : state.placements) {
    if (!moment.own_object[placement.object.value]) release(scenario, placement.object, moment);
    if (placement.X_WO) moment.X_WO[placement.object.value] = *placement.X_WO;
    moment.shown[placement.object.value] = placement.kind != PlacementKind::kHide;
  }
  for (const HandAssignment& assignment : state.hands)
    assign(scenario, assignment.hand, assignment.object, moment);
}

void end(const ScenarioFile& scenario, const ScenarioState& state, SceneMoment& moment) {
  if (!state.X_WG) return;
  moment.X_WO[state.object.value] = *state.X_WG;
  if (state.snap && !moment.own_object[state.object.value]) release(scenario, state.object, moment);
}

}  // namespace

bool SceneMoment::inAHand(ObjectId object) const {
  return std::find(hand_objects.begin(), hand_objects.end(), object) != hand_objects.end();
}

bool SceneMoment::collides(const ScenarioFile& scenario, std::size_t pair) const {
  const ScenarioPair& spec = scenario.pairs[pair];
  const std::uint32_t a = spec.a.value;
  const std::uint32_t b = spec.b.value;
  return pair_enabled[pair] && shown[a] && shown[b] && (group[a] == 0 || group[a] != group[b]);
}

std::vector<SceneMoment> momentsOf(const ScenarioFile& scenario) {
  std::vector<SceneMoment> moments;
  SceneMoment moment = startOf(scenario);
  for (const ScenarioState& state : scenario.states) {
    begin(scenario, state, moment);
    moments.push_back(moment);
    end(scenario, state, moment);
  }
  return moments;
}

std::optional<std::size_t> firstTarget(const ScenarioFile& scenario, ObjectId object) {
  for (std::size_t i = 0; i < scenario.states.size(); ++i)
    if (scenario.states[i].object == object && scenario.states[i].X_WG) return i;
  return std::nullopt;
}

}  // namespace tenon::game_control
