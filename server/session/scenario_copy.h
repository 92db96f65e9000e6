#pragma once

#include <cstdint>
#include <filesystem>
#include <utility>

#include "idl/record/mcap_reader.h"
#include "idl/record/mcap_writer.h"
#include "idl/types/result.h"
#include "server/game_control/scenario.h"

/// The files of a scenario inside its journal, so that this can be re-simulated on another machine.
///
/// What a journal holds are the scenario's YAML file, its mesh files, and the files that these refer to: each
/// as an attachment "scenario/NAME" of media type record::kCompressedType. Structures are not among them.
/// They are tens of times larger than meshes, and follow from them by the bake, which the journal's
/// fingerprint verifies. Generated parts are not either: every Tenon generates them.
namespace tenon::session {

/// [bytes] of files that a journal holds, before compression. Of a scenario with more the largest are left
/// out, and named with their hash instead.
inline constexpr std::uintmax_t kMostScenarioBytes = 256U << 20U;

/// Adds the files of `scenario` to a journal, before its first message. Fails when they cannot be read or the
/// journal cannot be written.
[[nodiscard]] Result<void> addScenarioFiles(record::McapWriter& journal,
                                            const game_control::ScenarioFile& scenario,
                                            std::uintmax_t most_bytes = kMostScenarioBytes);

/// Writes the files below `folder`, which is made, and returns the scenario's YAML file there. Fails when one
/// cannot be written or is damaged, and when the journal does not hold one, which the message names with its
/// size and hash.
[[nodiscard]] Result<std::filesystem::path> unpackScenario(const record::McapReader& journal,
                                                           const std::filesystem::path& folder);

/// The scenario of a journal in a temporary folder, which the destructor removes.
///
/// Threads: one. Real-time: no.
class UnpackedScenario {
 public:
  /// Fails as unpackScenario, naming `journal`.
  [[nodiscard]] static Result<UnpackedScenario> of(const std::filesystem::path& journal);
  ~UnpackedScenario();
  UnpackedScenario(UnpackedScenario&& other) noexcept
      : folder_(std::exchange(other.folder_, {})), scenario_(std::move(other.scenario_)) {}
  UnpackedScenario& operator=(UnpackedScenario&&) = delete;
  /// Its YAML file.
  [[nodiscard]] const std::filesystem::path& path() const { return scenario_; }

 private:
  explicit UnpackedScenario(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::filesystem::path folder_, scenario_;
};

}  // namespace tenon::session
