#pragma once

#include <filesystem>

#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {

enum class PictureMoment {
  kStart,     ///< everything at its start pose, ghosts at the targets
  kAssembly,  ///< during the assembly
};

/// Renders a scenario with its parts, at `detail` [-], to a PNG from the point of view of a person in front
/// of it. Supports peg_and_box; any other set is drawn as the engine bay. Fails when the file cannot be
/// written.
[[nodiscard]] Result<void> drawScenario(const PartSet& set, double detail, PictureMoment moment,
                                        const std::filesystem::path& file);

}  // namespace tenon::part_generator
