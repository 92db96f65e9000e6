#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace tenon::session {

/// The answer to the first argument that is a former option of tenon-serve: one line that names the present
/// option. Null when there is none.
[[nodiscard]] inline std::optional<std::string> renamedOption(std::span<const char* const> arguments) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 2> kRenamed{
      {{"--rerun", "--resimulate"}, {"--anyway", "--despite-changes"}}};
  for (const std::string_view argument : arguments) {
    const std::string_view option = argument.substr(0, argument.find('='));
    const auto* const found = std::find_if(kRenamed.begin(), kRenamed.end(),
                                           [&](const auto& renamed) { return renamed.first == option; });
    if (found != kRenamed.end())
      return "option " + std::string(found->first) + " is now named " + std::string(found->second);
  }
  return std::nullopt;
}

}  // namespace tenon::session
