#pragma once

#include <cstddef>

#include "server/check/checked_scene.h"

namespace tenon::check {

/// Examines the place of the part of state `state`: size, overlap, play, approach.
void checkTarget(CheckedScene& checked, std::size_t state);

}  // namespace tenon::check
