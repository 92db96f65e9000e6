#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/result.h"
#include "server/structures/haptic_structures.h"

namespace tenon::structures {

/// The bytes of a structure file without what differs from one bake of the same structures to another: the
/// time it took, and where the meshes are. Fails with a sentence when they could not be read again.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::vector<std::uint8_t>> structureBytes(const HapticStructures& structures);
/// As openStructures() of a file with `bytes`, which begin at a multiple of 8 bytes in memory; `file` is its
/// name in errors, and the paths of meshes are relative to its folder.
[[nodiscard]] Result<std::shared_ptr<const HapticStructures>> readStructures(
    std::span<const std::byte> bytes, const std::filesystem::path& file);

}  // namespace tenon::structures
