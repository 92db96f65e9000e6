#pragma once

#include <filesystem>

#include "scenarios/scenario_parts.h"

namespace tenon {

enum class Moment {
  kStart,     ///< everything where it waits, ghosts at the targets
  kAssembly,  ///< in the middle of the exercise
};

/// Draws a scenario with its parts as a person in front of it would see it.
[[nodiscard]] Result<void> drawScenario(const PartSet& set, double detail, Moment moment,
                                        const std::filesystem::path& file);

}  // namespace tenon
