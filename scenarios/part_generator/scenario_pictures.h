#pragma once

#include <filesystem>

#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {

enum class PictureMoment {
  kStart,     ///< everything at its start pose, ghosts at the targets
  kAssembly,  ///< during the assembly
};

/// Renders a scenario with its parts, at `detail` [-], to a PNG from the point of view of a person in front
/// of it. `set` is one of partSets(). `width` [pixels] is 8/5 of the height. Fails when the file cannot be
/// written.
[[nodiscard]] Result<void> drawScenario(const PartSet& set, double detail, PictureMoment moment,
                                        const std::filesystem::path& file, int width = 1600);

}  // namespace tenon::part_generator
