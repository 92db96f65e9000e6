#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/rehearse/rehearsal.h"
#include "clients/station/hand_trajectory.h"
#include "idl/types/ids.h"
#include "idl/types/result.h"
#include "server/game_control/scenario.h"

namespace tenon::rehearse {

/// A hand that follows a file.
struct ScriptedHand {
  HandId hand;
  std::filesystem::path file;
  std::optional<station::HandTrajectory> trajectory;  ///< none before readTrajectories()
};

/// Hands that follow files, and what some of them hold from the start on. All other hands are absent.
struct Script {
  std::vector<ScriptedHand> hands;
  std::vector<game_control::HandAssignment> takes;

  /// How to read a scenario that this script is for.
  [[nodiscard]] game_control::ReadOptions readOptions() const {
    return {.taken = takes, .needs_states = false};
  }
};

/// From `HAND=FILE` and `HAND=OBJECT`, as typed after --input and --take. Fails when one has no `=`, names no
/// hand or object of the scenario, or contradicts another: two files or objects for a hand, one object in two
/// hands, an object in a hand that follows no file. Files are not read.
[[nodiscard]] Result<Script> makeScript(const std::vector<std::string>& inputs,
                                        const std::vector<std::string>& takes,
                                        const game_control::ScenarioFile& scenario);

/// Reads the hands' files. Fails with the first error, see station::HandTrajectory::read.
[[nodiscard]] Result<void> readTrajectories(Script& script);

/// [s] Time of the last row of all files; they have been read.
[[nodiscard]] double endOf(const Script& script);

/// runRehearsal with a station for each hand of `script`, whose files have been read. `loaded` was read with
/// Script::readOptions. An object that is taken starts at the first pose of its hand. Fails when the server
/// refuses an input, as it does when a row is 1 km away or faster than 50 m/s or 50 rad/s; the error names
/// file, line and time.
[[nodiscard]] Result<RehearsalReport> runScript(const Script& script, const session::LoadedScene& loaded,
                                                RehearsalOptions options);

}  // namespace tenon::rehearse
