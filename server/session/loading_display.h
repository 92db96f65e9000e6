#pragma once

#include <string_view>

namespace tenon::session {

/// Shows an activity and its finished `fraction` [-], 0..1, on one line of the terminal at stderr, which the
/// next call overwrites and a finished one clears. Elsewhere it prints nothing.
///
/// Threads: one. Real-time: no.
void showOnTerminal(std::string_view activity, double fraction);

}  // namespace tenon::session
