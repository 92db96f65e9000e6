#pragma once

#include <cstdint>

#include "clients/rehearse/rehearsal.h"
#include "idl/types/result.h"
#include "server/session/scene_loader.h"

namespace tenon::bench {

/// A rehearsal of a loaded scenario by the simulated trainee of `options.seed`, and its instructor if it has
/// a hand for one. Fails when a station cannot be opened or is not admitted.
[[nodiscard]] Result<rehearse::RehearsalReport> rehearsePeople(const session::LoadedScene& loaded,
                                                               const rehearse::RehearsalOptions& options);

}  // namespace tenon::bench
