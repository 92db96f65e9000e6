#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tenon {

/// What is wrong with a mesh file that the importer would swallow and turn into nonsense: decimal commas in
/// an ASCII STL, a glTF rotation that is none. Nothing when it looks right.
[[nodiscard]] std::optional<std::string> problemInMeshFile(const std::filesystem::path& file);

}  // namespace tenon
