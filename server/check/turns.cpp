#include "server/check/turns.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "devices/catalog.h"

namespace tenon::check {
namespace {

/// Where the hand of a state takes its object: the orientation of the object in a hand that is not turned.
/// None: the object is in no hand by then.
struct GrabPlace {
  bool own = false;  ///< the hand's own object: held from the start on
  Quaternion q_HO = Quaternion::Identity();
};

GrabPlace grabPlace(const CheckedScene& checked, std::size_t state) {
  const game_control::ScenarioFile& scenario = checked.scenario;
  const ObjectId object = scenario.states[state].object;
  const HandId hand = scenario.states[state].hand;
  if (scenario.hands[hand.value].object == object) return {.own = true};
  // the newest state that gives the object to the hand
  for (std::size_t i = state + 1; i-- > 0;) {
    for (const game_control::HandAssignment& given : scenario.states[i].hands) {
      if (given.hand != hand || given.object != object) continue;
      const bool was_shown = i == 0 ? scenario.objects[object.value].status != ObjectStatus::kHidden
                                    : checked.moments[i - 1].shown[object.value];
      // one that was hidden comes into the hand with the hand's orientation
      if (!was_shown) return {};
      return {.q_HO = checked.moments[i].X_WO[object.value].rotation()};
    }
  }
  return {.q_HO = checked.moments[state].X_WO[object.value].rotation()};
}

}  // namespace

void checkTurns(CheckedScene& checked, const std::string& trainee_device,
                const std::string& instructor_device) {
  const auto trainee_caps = devices::capsOf(trainee_device);
  const auto instructor_caps = devices::capsOf(instructor_device);
  for (std::size_t i = 0; i < checked.scenario.states.size(); ++i) {
    const game_control::ScenarioState& state = checked.scenario.states[i];
    if (!state.X_WG || !state.hand.valid()) continue;
    const game_control::ScenarioHand& hand = checked.scenario.hands[state.hand.value];
    if (hand.kind != simulation::HandKind::kCoupled) continue;
    const bool is_instructors = hand.role == Role::kInstructor;
    const std::string& device = is_instructors ? instructor_device : trainee_device;
    const auto& caps = is_instructors ? instructor_caps : trainee_caps;
    if (!caps) continue;
    const GrabPlace grab = grabPlace(checked, i);
    const double turn = game_control::angleBetween(grab.q_HO, state.X_WG->rotation());
    const double beyond = turn - state.angle_tolerance - caps->rotation_range;
    if (beyond <= 0.0) continue;
    Finding finding{.kind = FindingKind::kTurning, .object = state.object, .state = state.name};
    finding.line = state.line;
    finding.value = turn;
    finding.unit = "rad";
    const auto* structures = checked.scene.objects[state.object.value].structures.get();
    finding.p_WP = *state.X_WG * simulation::boundingSphereOf(structures).p_OQ_O;
    const std::string range = caps->rotation_range > 0.0 ? fmt::format("turns by {} from its middle",
                                                                       inDegrees(caps->rotation_range))
                                                         : "does not turn";
    finding.text = fmt::format("{} has to be turned by {} to its target, and {} {}",
                               checked.titleOf(state.object), inDegrees(turn), device, range);
    // a part can be taken with the hand turned the other way
    const bool possible = !grab.own && beyond <= caps->rotation_range;
    finding.severity = possible ? Severity::kWarning : Severity::kError;
    if (grab.own) {
      finding.hint = "turn the target, or the mesh of what the hand holds";
    } else if (caps->rotation_range <= 0.0) {
      finding.hint = "let it start turned as at its target";
    } else {
      finding.hint = fmt::format("let it start turned by {} or more towards its target{}", inDegrees(beyond),
                                 possible ? ", or be taken with the hand turned the other way" : "");
    }
    checked.findings.push_back(std::move(finding));
  }
}

}  // namespace tenon::check
