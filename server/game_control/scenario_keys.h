#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tenon::game_control {

/// The keys that one kind of mapping in a scenario file may have. `name` is that of its definition in
/// `scenarios/scenario.schema.json`; a test compares schema and this list.
///
/// Threads: constant. Real-time: no.
struct ScenarioMapping {
  std::string_view name;
  std::span<const std::string_view> keys;
};

[[nodiscard]] std::span<const ScenarioMapping> scenarioMappings();

/// The mapping of that name, which must exist (assert).
[[nodiscard]] const ScenarioMapping& scenarioMapping(std::string_view name);

/// The present name of a key that was renamed, empty for any other key: a file that uses the old one is
/// refused with a message that names the new one.
[[nodiscard]] std::string_view renamedKey(std::string_view mapping, std::string_view key);

/// What to do instead of a key that was removed, empty for any other key.
[[nodiscard]] std::string_view removedKey(std::string_view mapping, std::string_view key);

/// `did you mean 'object'?` with the candidate of the smallest edit distance; empty when none is near.
[[nodiscard]] std::string suggestion(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace tenon::game_control
