#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "clients/report/session_analysis.h"

namespace tenon::report {

/// "0.31 of 2.0": last error against tolerance [mm]; empty without a target.
[[nodiscard]] std::string errorText(const StepVisit& visit);

/// Title of a step, with the number of the attempt from the second on.
[[nodiscard]] std::string titleText(const StepVisit& visit);

/// Result of a step in words.
[[nodiscard]] std::string_view resultOf(const StepVisit& visit);

/// "succeeded", or how the run ended instead.
[[nodiscard]] std::string outcomeOf(const SessionAnalysis& analysis);

/// What a station's link did: jitter, losses, round trip and clocks, in words.
[[nodiscard]] std::string linkText(const ForceLatency& latency);

/// Table of the session as aligned text.
[[nodiscard]] std::string summaryText(const SessionAnalysis& analysis);

/// The same as JSON; SI units, times in [s].
[[nodiscard]] nlohmann::json summaryJson(const SessionAnalysis& analysis);

}  // namespace tenon::report
