#include "server/session/command_translator.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "server/session/rights.h"

namespace tenon::session {
namespace {

Change gameChange(const Command& command, std::uint32_t signal = 0) {
  Change change{.kind = ChangeKind::kGameCommand};
  change.game = {command.kind, command.hand, signal, command.value};
  return change;
}

}  // namespace

int CommandTranslator::findPair(std::string_view a, std::string_view b) const {
  const ObjectId object_a = scenario_.objectNamed(a);
  const ObjectId object_b = scenario_.objectNamed(b);
  return object_a.valid() && object_b.valid() ? scenario_.pairOf(object_a, object_b) : -1;
}

/// Index of the step with this name or number, from 1; -1 if there is none.
int CommandTranslator::findStep(std::string_view text) const {
  const auto& states = scenario_.states;
  const auto named =
      std::find_if(states.begin(), states.end(), [&](const auto& state) { return state.name == text; });
  if (named != states.end()) return static_cast<int>(named - states.begin());
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_step =
      error == std::errc() && end == text.data() + text.size() && number >= 1 && number <= states.size();
  return is_step ? static_cast<int>(number) - 1 : -1;
}

/// Of the two force-coupled hands of the trainee.
CommandTranslator::Decision CommandTranslator::swapChange(const Command& command,
                                                          const CommandContext& context) const {
  std::size_t swappable = 0, own = 0;
  for (std::uint32_t i = 0; i < scenario_.hands.size(); ++i) {
    const game_control::ScenarioHand& hand = scenario_.hands[i];
    if (hand.role != Role::kTrainee || hand.kind != simulation::HandKind::kCoupled) continue;
    ++swappable;
    if (command.client.valid() && context.controllers[i] == command.client) ++own;
  }
  if (!has(context.role, Right::kActOnAnyHand) && own < swappable)
    return refuse(Refusal::kNotYourHand, "you do not control both hands");
  if (swappable != 2)
    return refuse(
        Refusal::kOther,
        fmt::format("two hands are swapped, and the trainee of this scenario has {} that take parts",
                    swappable));
  return gameChange(command);
}

CommandTranslator::Decision CommandTranslator::changeFor(const Command& command,
                                                         const CommandContext& context) const {
  if (!std::isfinite(command.value)) return refuse(Refusal::kOther, "its value is not a finite number");
  switch (command.kind) {
    case CommandKind::kFulfilled:
      return gameChange(command);
    case CommandKind::kSignal: {
      const int signal = scenario_.signalNamed(command.text);
      if (signal < 0)
        return refuse(Refusal::kUnknownName, "this scenario has no signal " + inQuotes(command.text) +
                                                 namesInstead(scenario_.signals));
      return gameChange(command, static_cast<std::uint32_t>(signal));
    }
    case CommandKind::kRelease:
      return releaseChange(command, context);
    case CommandKind::kSwapHands:
      return swapChange(command, context);
    case CommandKind::kClearEmergencyStop:
      return clearStopChange(command, context);
    default:
      return leadChange(command, context);
  }
}

CommandTranslator::Decision CommandTranslator::releaseChange(const Command& command,
                                                             const CommandContext& context) const {
  const HandId hand = command.hand.valid() ? command.hand : scenario_.handNamed(command.text);
  const bool is_own = hand.value < context.controllers.size() && command.client.valid() &&
                      context.controllers[hand.value] == command.client;
  if (!has(context.role, Right::kActOnAnyHand) && !is_own)
    return refuse(Refusal::kNotYourHand, "you do not control that hand");
  if (hand.value >= context.controllers.size())
    return refuse(Refusal::kUnknownName, command.text.empty()
                                             ? "there is no such hand"
                                             : "this scenario has no hand " + inQuotes(command.text) +
                                                   namesInstead(scenario_.hands));
  return Change{.kind = ChangeKind::kRelease, .hand = hand};
}

/// Of "OBJECT HAND".
CommandTranslator::Decision CommandTranslator::handOverChange(const Command& command,
                                                              const CommandContext& context) const {
  const std::size_t space = command.text.find(' ');
  const ObjectId object = scenario_.objectNamed(command.text.substr(0, space));
  const HandId hand =
      space == std::string::npos ? HandId{} : scenario_.handNamed(command.text.substr(space + 1));
  if (!object.valid() || !hand.valid())
    return refuse(
        Refusal::kUnknownName,
        fmt::format("{} does not name {}", inQuotes(command.text),
                    object.valid() ? "a hand" : (hand.valid() ? "an object" : "an object and a hand")));
  const auto& hands = scenario_.hands;
  const bool is_own =
      std::any_of(hands.begin(), hands.end(), [&](const auto& h) { return h.object == object; });
  const game_control::ScenarioObject& spec = scenario_.objects[object.value];
  if (is_own || spec.status == ObjectStatus::kFixed)
    return refuse(Refusal::kNotHoldable, fmt::format("'{}' is nothing that a hand takes", spec.name));
  if (hands[hand.value].kind == simulation::HandKind::kTracked)
    return refuse(Refusal::kNotHoldable,
                  fmt::format("hand '{}' is tracked, it cannot hold a part", hands[hand.value].name));
  if (!context.controllers[hand.value].valid())
    return refuse(Refusal::kNobodyThere, fmt::format("nobody moves hand '{}'", hands[hand.value].name));
  Change change = gameChange(command, object.value);
  change.game.hand = hand;
  return change;
}

CommandTranslator::Decision CommandTranslator::clearStopChange(const Command& command,
                                                               const CommandContext& context) const {
  if (!context.is_stop_engaged) return refuse(Refusal::kAlready, "there is no emergency stop");
  if (context.role == Role::kAdmin && context.is_instructor_present)
    return refuse(Refusal::kNotPermitted,
                  "an instructor is present: it is for the instructor to clear the emergency stop");
  // also a number of another life of the server, which may be the larger one
  if (command.value != context.newest.number)
    return refuse(
        Refusal::kRaisedAgain,
        fmt::format("a newer raise stands than those you were told of, by {}: {}; look, then clear it",
                    printable(context.newest.who), printable(context.newest.reason)));
  return Change{.kind = ChangeKind::kSetEmergencyStop, .value = 0.0};
}

/// Of "A B".
CommandTranslator::Decision CommandTranslator::collisionChange(const Command& command) const {
  const std::size_t space = command.text.find(' ');
  const int pair = space == std::string::npos
                       ? -1
                       : findPair(command.text.substr(0, space), command.text.substr(space + 1));
  if (pair < 0)
    return refuse(Refusal::kUnknownName,
                  inQuotes(command.text) + " does not name the two objects of a collision pair");
  return Change{
      .kind = ChangeKind::kEnablePair, .index = static_cast<std::uint32_t>(pair), .value = command.value};
}

CommandTranslator::Decision CommandTranslator::leadChange(const Command& command,
                                                          const CommandContext& context) const {
  switch (command.kind) {
    case CommandKind::kPause:
      return Change{.kind = ChangeKind::kPause};
    case CommandKind::kResume:
      return Change{.kind = ChangeKind::kResume};
    case CommandKind::kStop:
      return Change{.kind = ChangeKind::kStop};
    case CommandKind::kFreezeForces:
      return Change{.kind = ChangeKind::kFreezeForces, .value = command.value};
    case CommandKind::kBack:
      if (context.step == 0U)
        return refuse(Refusal::kOther, "there is no step before the first one; `repeat` begins it anew");
      return gameChange(command);
    case CommandKind::kReset:
    case CommandKind::kSkipStep:
    case CommandKind::kRepeatStep:
      return gameChange(command);
    case CommandKind::kGoToStep: {
      const int step = findStep(command.text);
      if (step < 0)
        return refuse(Refusal::kUnknownName,
                      fmt::format("this scenario has no step {}: it has 1 to {}, or name one",
                                  inQuotes(command.text), scenario_.states.size()));
      return gameChange(command, static_cast<std::uint32_t>(step));
    }
    case CommandKind::kHandOver:
      return handOverChange(command, context);
    case CommandKind::kSetCollision:
      return collisionChange(command);
    default:
      return refuse(Refusal::kOther, "unknown command");
  }
}

}  // namespace tenon::session
