#pragma once

#include <array>
#include <string>
#include <string_view>
#include <utility>

#include "server/game_control/yaml_reader.h"

namespace tenon::game_control {

/// The words that a key of a scenario may have as its value, and what they mean.
template <typename Value, std::size_t N>
using NamedValues = std::array<std::pair<std::string_view, Value>, N>;

/// The value with that name, `default_value` when the key is missing; an error lists all names. `what`
/// describes the value in errors.
template <typename Value, std::size_t N>
Value oneOf(YamlReader& yaml, const YAML::Node& node, const std::string& what,
            const NamedValues<Value, N>& values, Value default_value) {
  if (!node.IsDefined()) return default_value;
  const std::string word = yaml.text(node, what);
  std::string expected;
  for (const auto& [known, value] : values) {
    if (known == word) return value;
    expected += (expected.empty() ? "" : ", ") + std::string(known);
  }
  yaml.fail(node, what + " is '" + word + "', expected one of: " + expected);
  return default_value;
}

}  // namespace tenon::game_control
