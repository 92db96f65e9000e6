#pragma once

#include "server/check/checked_scene.h"

namespace tenon::check {

/// Empty space of meshes that is solid in their fields, as notes: the largest spaces of each object one by
/// one, the others counted. Places are those of the start.
void checkFilledSpaces(CheckedScene& checked);

}  // namespace tenon::check
