#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tenon::bake {

/// An error in a mesh file that the importer would accept and misread: decimal commas in an ASCII STL, a glTF
/// rotation that is not a unit quaternion. Empty when none is found in the first 16 MiB.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::optional<std::string> problemInMeshFile(const std::filesystem::path& file);

}  // namespace tenon::bake
