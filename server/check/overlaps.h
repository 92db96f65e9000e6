#pragma once

#include "server/check/checked_scene.h"

namespace tenon::check {

/// Finds objects that are inside each other where they appear: at the start, and when a state places them.
void checkOverlaps(CheckedScene& checked);

}  // namespace tenon::check
