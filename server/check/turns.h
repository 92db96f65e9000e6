#pragma once

#include <string>

#include "server/check/checked_scene.h"

namespace tenon::check {

/// Compares turns from where parts are taken to their targets with what devices have; names of the catalog.
void checkTurns(CheckedScene& checked, const std::string& trainee_device,
                const std::string& instructor_device);

}  // namespace tenon::check
