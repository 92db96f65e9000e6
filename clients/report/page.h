#pragma once

#include <string>

#include "clients/report/session_analysis.h"

namespace tenon::report {

/// The report as one self-contained HTML page (no script, no font, no network), in light or dark colours as
/// the reader's system is set; it prints in light.
///
/// `picture`: path of a picture of the scene relative to the page, or empty.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string reportPage(const SessionAnalysis& analysis, const std::string& picture);

}  // namespace tenon::report
