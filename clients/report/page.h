#pragma once

#include <string>

#include "clients/report/session_story.h"

namespace tenon {

/// The report as one HTML page that needs nothing else: no script, no font, no network. Follows the reader's
/// light or dark setting and prints in light.
///
/// `picture`: path of a picture of the scene as seen from the page, or empty.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string reportPage(const SessionStory& story, const std::string& picture);

}  // namespace tenon
