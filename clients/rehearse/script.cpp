#include "clients/rehearse/script.h"

#include <algorithm>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "clients/rehearse/scripted_station.h"

namespace tenon::rehearse {
namespace {

struct Assignment {
  HandId hand;
  std::string value;
};

template <typename Container>
std::string namesOf(const Container& container) {
  std::string names;
  for (const auto& item : container) names += (names.empty() ? "" : ", ") + item.name;
  return names;
}

/// `HAND=VALUE`; `option` and `value` ("FILE") are those of the help text.
Result<Assignment> parseAssignment(const std::string& text, std::string_view option, std::string_view value,
                                   const game_control::ScenarioFile& scenario) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    return fail(fmt::format("{} '{}': expected HAND={}", option, text, value));
  const std::string name = text.substr(0, equals);
  const HandId hand = scenario.handNamed(name);
  if (!hand.valid())
    return fail(fmt::format("{} {}: this scenario has no hand '{}'; it has: {}", option, text, name,
                            namesOf(scenario.hands)));
  return Assignment{hand, text.substr(equals + 1)};
}

const ScriptedHand* find(const Script& script, HandId hand) {
  const auto found = std::find_if(script.hands.begin(), script.hands.end(),
                                  [hand](const ScriptedHand& one) { return one.hand == hand; });
  return found == script.hands.end() ? nullptr : &*found;
}

/// Why `take` cannot be added to `script`; empty: it can.
std::string refusalOf(const game_control::HandAssignment& take, const Script& script,
                      const game_control::ScenarioFile& scenario) {
  const std::string& hand = scenario.hands[take.hand.value].name;
  const std::string& object = scenario.objects[take.object.value].name;
  if (find(script, take.hand) == nullptr)
    return fmt::format("hand '{}' would not move, expected --input {}=FILE with it", hand, hand);
  for (const game_control::HandAssignment& other : script.takes) {
    if (other.hand == take.hand)
      return fmt::format("hand '{}' already takes '{}'", hand, scenario.objects[other.object.value].name);
    if (other.object == take.object)
      return fmt::format("'{}' is already taken by hand '{}'", object, scenario.hands[other.hand.value].name);
  }
  for (const ScriptedHand& other : script.hands)
    if (other.hand != take.hand && scenario.hands[other.hand.value].object == take.object)
      return fmt::format("'{}' is the own object of hand '{}', which --input moves", object,
                         scenario.hands[other.hand.value].name);
  return {};
}

}  // namespace

Result<Script> makeScript(const std::vector<std::string>& inputs, const std::vector<std::string>& takes,
                          const game_control::ScenarioFile& scenario) {
  Script script;
  for (const std::string& text : inputs) {
    const auto input = parseAssignment(text, "--input", "FILE.csv", scenario);
    if (!input) return tl::unexpected(input.error());
    if (const ScriptedHand* other = find(script, input->hand))
      return fail(fmt::format("--input {}: hand '{}' already follows {}", text,
                              scenario.hands[input->hand.value].name, other->file.string()));
    script.hands.push_back({input->hand, input->value, std::nullopt});
  }
  for (const std::string& text : takes) {
    const auto typed = parseAssignment(text, "--take", "OBJECT", scenario);
    if (!typed) return tl::unexpected(typed.error());
    const game_control::HandAssignment take{typed->hand, scenario.objectNamed(typed->value)};
    if (!take.object.valid())
      return fail(fmt::format("--take {}: this scenario has no object '{}'; it has: {}", text, typed->value,
                              namesOf(scenario.objects)));
    if (const std::string refusal = refusalOf(take, script, scenario); !refusal.empty())
      return fail(fmt::format("--take {}: {}", text, refusal));
    script.takes.push_back(take);
  }
  return script;
}

Result<void> readTrajectories(Script& script) {
  for (ScriptedHand& hand : script.hands) {
    auto trajectory = station::HandTrajectory::read(hand.file);
    if (!trajectory) return fail(trajectory.error().what);
    hand.trajectory = std::move(*trajectory);
  }
  return {};
}

double endOf(const Script& script) {
  double end = 0.0;
  for (const ScriptedHand& hand : script.hands) end = std::max(end, hand.trajectory->end());
  return end;
}

Result<RehearsalReport> runScript(const Script& script, const session::LoadedScene& loaded,
                                  RehearsalOptions options) {
  std::vector<std::unique_ptr<haptic::Station>> stations;
  options.needed_hands.emplace();
  for (const ScriptedHand& hand : script.hands) {
    const game_control::ScenarioHand& spec = loaded.scenario->hands[hand.hand.value];
    stations.push_back(std::make_unique<ScriptedStation>(spec.name, spec.role, *hand.trajectory));
    options.needed_hands->push_back(hand.hand);
  }
  options.takes = script.takes;
  std::string refusal;
  options.on_refused = [&](const DeviceInput& input, const std::string& why) {
    const ScriptedHand& hand = *find(script, input.hand);
    const double t = secondsAt(input.sample.seq);
    if (refusal.empty())
      refusal = fmt::format("{}:{}: at {} s the server refuses the input: {}", hand.file.string(),
                            hand.trajectory->lineAt(t), t, why);
  };
  options.stop_when = [&refusal, stop = std::move(options.stop_when)] {
    return !refusal.empty() || (stop && stop());
  };
  auto report = runRehearsal(loaded, std::move(stations), options);
  if (!refusal.empty()) return fail(refusal);
  return report;
}

}  // namespace tenon::rehearse
