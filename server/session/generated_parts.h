#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "idl/types/result.h"
#include "server/game_control/scenario.h"

namespace tenon::session {

/// A set of parts that the part generator makes.
struct GeneratedSet {
  std::string name;
  std::vector<std::string> parts;
};

/// The sets in what `tenon-parts --list` prints: a set's name at the beginning of a line, below it its parts,
/// indented.
[[nodiscard]] std::vector<GeneratedSet> parseSetList(const std::string& list);

/// The set that has the parts a scenario's meshes name: the one its key `parts` states; else the one with the
/// name of its folder, if that has all of them; else the only one that has. Empty when the scenario names no
/// part. Fails with file and line when a part is in no such set, or when several sets have all of them.
[[nodiscard]] Result<std::string> generatedSetOf(const game_control::ScenarioFile& scenario,
                                                 const std::vector<GeneratedSet>& sets);

/// The folder of the generated parts of a scenario, at `detail` [-] 0..1, below the folder `cache`; runs the
/// generator unless it is up to date, after a call of `on_generation`, which may be empty. Empty when the
/// scenario names no part. The generator is $TENON_PARTS, or tenon-parts beside this program; it is ended
/// once `stop`, which may be null, is set. Fails when the generator does, or as generatedSetOf; then no new
/// folder is left.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<std::filesystem::path> generatedParts(const game_control::ScenarioFile& scenario,
                                                           const std::filesystem::path& cache, double detail,
                                                           const std::function<void()>& on_generation = {},
                                                           const std::atomic<bool>* stop = nullptr);

}  // namespace tenon::session
