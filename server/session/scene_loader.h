#pragma once

#include <atomic>
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

namespace tenon::session {

struct LoadOptions {
  std::filesystem::path cache;  ///< folder of baked structures and generated parts
  double detail = 1.0;          ///< [-] mesh resolution of generated parts, 0..1; 1 is the scene of the paper
  game_control::ReadOptions read;  ///< of the scenario file
  /// Once it is set, loading ends soon with an error, and leaves nothing half-written in the cache; null:
  /// nothing stops it.
  const std::atomic<bool>* stop = nullptr;

  [[nodiscard]] bool isStopped() const { return stop != nullptr && *stop; }
};

/// Called with the current activity, as in "engine bay: signs", and its finished `fraction` [-], 0..1.
using LoadProgress = std::function<void(std::string_view activity, double fraction)>;

/// The constant data of a session.
struct LoadedScene {
  std::shared_ptr<const game_control::ScenarioFile> scenario;
  std::shared_ptr<const simulation::Scene> scene;
};

/// Identifies scenario and structures of a session, to detect changes before a re-simulation. Empty members
/// are unknown and compare as unchanged.
struct Fingerprint {
  std::string scenario;                           ///< hash of its text, 16 hexadecimal digits
  std::map<std::string, std::string> structures;  ///< content hash by object name
};

[[nodiscard]] Fingerprint fingerprintOf(const LoadedScene& loaded);

/// The differences in words: "the text of scenario.yaml", "the structures of 'peg'". Empty: none.
[[nodiscard]] std::vector<std::string> changesSince(const Fingerprint& then, const LoadedScene& now);

/// Reads a scenario (its YAML file or the folder of it), generates its parts and bakes its meshes unless the
/// cache has them, and builds the scene. Fails with the first problem, named with file and line where known.
///
/// Threads: one; baking uses several inside. Real-time: no.
[[nodiscard]] Result<LoadedScene> loadScene(const std::filesystem::path& scenario, const LoadOptions& options,
                                            const LoadProgress& progress = {});

/// A sentence for each object with walls thinner than its voxels resolve (their share of the surface, by how
/// much the bake thickens them, the share that is open, where a part could pass), and one for narrow gaps.
[[nodiscard]] std::vector<std::string> thinWallReport(const simulation::Scene& scene);
/// A scenario and the structures of its objects, by ObjectId; null for one that is not collidable.
struct LoadedStructures {
  std::shared_ptr<const game_control::ScenarioFile> scenario;
  std::vector<std::shared_ptr<const structures::HapticStructures>> structures;
};

/// The part of loadScene() before the scene is built, of a scenario that has been read.
[[nodiscard]] Result<LoadedStructures> loadStructures(
    std::shared_ptr<const game_control::ScenarioFile> scenario, const LoadOptions& options,
    const LoadProgress& progress = {});

/// [m] Bounding boxes of the meshes of each object, in its frame, by ObjectId; empty where they cannot be
/// read. Reads every mesh and bakes nothing.
[[nodiscard]] std::vector<Eigen::AlignedBox3d> meshBoxes(const game_control::ScenarioFile& scenario,
                                                         const LoadOptions& options);

/// Makes the display models of all objects unless the cache has them, and the compiled scene
/// (server/simulation/compiled_scene.h, compressed by zstd), keeps them in the asset store `cache`/assets,
/// and returns the name of the list of them: SessionAnnounce::scene_hash. The list is JSON, {"version": 1,
/// "compiled": asset, "objects": [levels by ObjectId]}, a level {"model": asset, "triangles": number,
/// "error": [m]}, the finest first; an object whose meshes cannot be read has none. Fails when the store
/// cannot be written.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<std::string> storeAssets(const LoadedScene& loaded, const LoadOptions& options);

}  // namespace tenon::session
