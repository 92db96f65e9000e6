#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "clients/report/embedded_session.h"
#include "idl/types/result.h"

namespace tenon::report {

/// Largest report [bytes] that is made of a session.
inline constexpr std::size_t kMaxReportBytes = 8'000'000;

/// The page that `clients/console/web` is built to for reports: beside this program, in the build or
/// installed tree.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::filesystem::path defaultReportPage();

/// Reads the page without a session. Fails with a sentence, which says how it is built, when it is not there.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::string> readReportPage(const std::filesystem::path& file);

/// Bytes that an embedded session may have in a report of that page and data, so that it stays below
/// kMaxReportBytes.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::size_t sessionBudget(std::string_view page, const nlohmann::json& data);

/// The report: one HTML file with everything inside, which asks for nothing from elsewhere. `data` is
/// pageData(); without `session` the report has no player, and data["no_player"] may say why.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string reportPage(std::string_view page, const nlohmann::json& data,
                                     const EmbeddedSession* session);

}  // namespace tenon::report
