#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "server/game_control/scenario.h"
#include "server/simulation/scene.h"

namespace tenon {

struct LoadOptions {
  std::filesystem::path cache;  ///< structures and generated parts are kept here
  double detail = 0.12;         ///< of generated parts, 0..1; 1 is the paper's scene
};

/// What is being done, for a person who waits: "engine bay: signs", 0.4.
using LoadProgress = std::function<void(std::string_view doing, double share)>;

/// Everything of a scenario that a running session only reads.
struct LoadedScene {
  std::shared_ptr<const ScenarioFile> scenario;
  std::shared_ptr<const Scene> scene;
};

/// What a session was made of, to be compared years later. Empty where it is not known.
struct Fingerprint {
  std::string scenario;                           ///< hash of its text
  std::map<std::string, std::string> structures;  ///< content hash, by name of the object
};

[[nodiscard]] Fingerprint fingerprintOf(const LoadedScene& loaded);

/// What is not as it was, as a person calls it: "the text of scenario.yaml", "the structures of 'peg'".
[[nodiscard]] std::vector<std::string> changesSince(const Fingerprint& then, const LoadedScene& now);

/// Reads a scenario, has its parts generated and its meshes baked (both through the cache), and builds the
/// scene.
[[nodiscard]] Result<LoadedScene> loadScene(const std::filesystem::path& scenario, const LoadOptions& options,
                                            const LoadProgress& progress = {});

/// Where programs keep what they can make again: $TENON_CACHE, $XDG_CACHE_HOME/tenon or ~/.cache/tenon.
[[nodiscard]] std::filesystem::path defaultCache();

}  // namespace tenon
