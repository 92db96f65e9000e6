#pragma once

#include "server/check/checked_scene.h"

namespace tenon::check {

/// Surfaces that the dilation of thin walls leaves open.
void checkOpenSurfaces(CheckedScene& checked);

}  // namespace tenon::check
