#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tenon {

/// The keys a mapping of a scenario file may have. Its name is that of the definition in
/// `scenarios/scenario.schema.json`, which a test holds equal to this list.
///
/// Threads: constant. Real-time: no.
struct ScenarioMapping {
  std::string_view name;
  std::span<const std::string_view> keys;
};

[[nodiscard]] std::span<const ScenarioMapping> scenarioMappings();

/// The mapping of that name; one that does not exist is a broken promise between our own functions.
[[nodiscard]] const ScenarioMapping& scenarioMapping(std::string_view name);

/// `did you mean 'object'?`, or nothing when no candidate is near.
[[nodiscard]] std::string suggestion(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace tenon
