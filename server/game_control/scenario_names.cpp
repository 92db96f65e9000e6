#include "server/game_control/scenario_names.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include "server/game_control/scenario_keys.h"
#include "server/game_control/text_limits.h"

namespace tenon::game_control {
namespace {

template <typename Container>
std::string hintFor(const std::string& name, const Container& container) {
  std::vector<std::string_view> names;
  for (const auto& item : container) names.push_back(item.name);
  const std::string hint = suggestion(name, names);
  return hint.empty() ? "" : "; " + hint;
}

}  // namespace

ObjectId ScenarioNames::object(const YAML::Node& node, const std::string& what) const {
  const std::string name = yaml_.text(node, what);
  if (name.empty()) return {};
  const ObjectId object = scenario_.objectNamed(name);
  if (!object.valid()) {
    yaml_.fail(node, what + " names an unknown object '" + name + "'" + hintFor(name, scenario_.objects));
  }
  return object;
}

HandId ScenarioNames::hand(const YAML::Node& node, const std::string& what) const {
  const std::string name = yaml_.text(node, what);
  if (name.empty()) return {};
  const HandId hand = scenario_.handNamed(name);
  if (!hand.valid()) {
    yaml_.fail(node, what + " names an unknown hand '" + name + "'" + hintFor(name, scenario_.hands));
  }
  return hand;
}

std::optional<std::pair<ObjectId, ObjectId>> ScenarioNames::twoObjects(const YAML::Node& node,
                                                                       const std::string& what) const {
  if (!node.IsDefined() || !node.IsSequence() || node.size() != 2) {
    yaml_.fail(node, what + " must be a list of two objects [a, b]");
    return std::nullopt;
  }
  const ObjectId a = object(node[0], what);
  const ObjectId b = object(node[1], what);
  if (!a.valid() || !b.valid()) return std::nullopt;
  if (a == b) {
    yaml_.fail(node, what + " names '" + nameOf(a) + "' twice, expected two objects");
    return std::nullopt;
  }
  return std::pair{a, b};
}

std::optional<std::uint32_t> ScenarioNames::pair(const YAML::Node& node, const std::string& what) const {
  const auto objects = twoObjects(node, what);
  if (!objects) return std::nullopt;
  const int index = scenario_.pairOf(objects->first, objects->second);
  if (index < 0) {
    yaml_.fail(node, what + ": '" + nameOf(objects->first) + "' and '" + nameOf(objects->second) +
                         "' never collide (same group, none of them ever moves, or one is not collidable)");
    return std::nullopt;
  }
  return static_cast<std::uint32_t>(index);
}

std::uint32_t ScenarioNames::group(const YAML::Node& node, const std::string& what) const {
  const std::string name = yaml_.text(node, what);
  if (name.empty() || name == "none") return 0;
  std::vector<std::string>& groups = scenario_.groups;
  const auto found = std::find(groups.begin(), groups.end(), name);
  const auto number = static_cast<std::uint32_t>(found - groups.begin()) + 1;
  if (found == groups.end()) groups.push_back(name);
  return number;
}

Texts ScenarioNames::texts(const YAML::Node& node, const std::string& what, std::size_t most) const {
  Texts texts;
  if (!node.IsDefined()) return texts;
  if (!node.IsMap()) {
    texts.push_back({scenario_.language, yaml_.text(node, what, most)});
    return texts;
  }
  for (const auto& entry : node) {
    texts.push_back({yaml_.text(entry.first, "a language of " + what, kMaxLanguage),
                     yaml_.text(entry.second, what, most)});
  }
  if (texts.size() > kMaxLanguages) {
    yaml_.fail(node, what + " has " + std::to_string(texts.size()) + " languages, at most " +
                         std::to_string(kMaxLanguages) + " can be sent");
    return texts;
  }
  const auto main_text = std::find_if(texts.begin(), texts.end(), [&](const LocalizedText& text) {
    return text.language == scenario_.language;
  });
  if (main_text == texts.end()) {
    yaml_.fail(node, what + " has no text in '" + scenario_.language + "', the scenario's main language");
    return texts;
  }
  std::rotate(texts.begin(), main_text, main_text + 1);
  return texts;
}

}  // namespace tenon::game_control
