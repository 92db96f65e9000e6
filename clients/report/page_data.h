#pragma once

#include <cstddef>

#include <nlohmann/json.hpp>

#include "clients/report/session_analysis.h"

namespace tenon::report {

/// Most values of a series in a page: of a longer session each is the largest of a longer time.
inline constexpr std::size_t kMaxColumns = 4000;

/// What the report's page shows of an analysis, beside the player: the summary, the series of the plots with
/// `seconds` [s] a value (the largest in that time, null without one), and the events. SI units, load in [%].
///
/// Threads: any. Real-time: no.
[[nodiscard]] nlohmann::json pageData(const SessionAnalysis& analysis);

}  // namespace tenon::report
