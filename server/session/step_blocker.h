#pragma once

#include <string>

#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Why the step of `output` is not done yet, as a sentence with the titles of the objects: "Peg is held 9.8
/// mm from its place by Tray, at (12, 0, -59) mm". What holds an object that a hand moves is the contact that
/// exerts the largest force on it.
///
/// Threads: pure. Real-time: no.
[[nodiscard]] std::string whatBlocks(const game_control::ScenarioFile& scenario, const TickOutput& output);

}  // namespace tenon::session
