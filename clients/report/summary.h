#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "clients/report/session_story.h"

namespace tenon {

[[nodiscard]] std::string_view phaseName(StepPhase phase);

/// "succeeded", or what it came to instead.
[[nodiscard]] std::string outcomeOf(const SessionStory& story);

/// The table of a session as aligned text for people.
[[nodiscard]] std::string summaryText(const SessionStory& story);

/// The same for programs; SI units, times in seconds.
[[nodiscard]] nlohmann::json summaryJson(const SessionStory& story);

}  // namespace tenon
