#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/result.h"
#include "server/simulation/scene.h"

namespace tenon::simulation {

/// A scene in one piece, the same bytes wherever it was baked: all that an Environment is made of, so that
/// one of the read scene has bit-equal ticks. Texts for people are not in it. Structures that
/// several objects share are in it once. Fails with a sentence when the scene could not be read again.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::vector<std::uint8_t>> sceneBytes(const Scene& scene);

/// The scene of sceneBytes(). Whatever the bytes are, they are refused with a sentence, or give a scene that
/// is safe to simulate: sizes are checked before anything is reserved, ids refer to what is there, numbers
/// are finite and in the range that scenarios have, structures are sound
/// (server/structures/structure_checks.h).
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::shared_ptr<const Scene>> readScene(std::span<const std::uint8_t> bytes);

}  // namespace tenon::simulation
