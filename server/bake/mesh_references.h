#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tenon::bake {

/// Another file that a mesh file refers to.
struct MeshReference {
  std::filesystem::path named;  ///< absolute and normal, in or below the folder of the mesh's name
  std::filesystem::path file;   ///< what is read for it; empty: there is none
  bool only_colors = false;     ///< it changes no triangle: a bake does not depend on it
};

/// The files beside itself that a mesh consists of: what `uri` names in a glTF (.gltf, .glb), as it is
/// written and with %20 and the like decoded, and the material libraries of an OBJ (`mtllib`). Only files in
/// or below the mesh's folder are listed. A file is looked for beside the mesh's name, then, when the mesh is
/// a symbolic link, beside what it points to; links on the way are followed.
///
/// The importer opens no other file, so these and the mesh itself are all that a bake or a display model
/// depends on.
[[nodiscard]] std::vector<MeshReference> referencesOf(const std::filesystem::path& mesh);

}  // namespace tenon::bake
