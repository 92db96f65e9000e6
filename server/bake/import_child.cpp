#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <assimp/DefaultIOSystem.h>
#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <sys/resource.h>
#include <unistd.h>

#include "idl/types/spatial.h"
#include "server/bake/bake.h"
#include "server/bake/import_pipe.h"
#include "server/bake/mesh_references.h"
#include "server/bake/octree_file.h"

namespace tenon::bake {

namespace {

constexpr std::size_t kMaxTriangles = 60'000'000;

/// Opens only the mesh and what it refers to, which are all that the cache of baked structures knows of.
class OwnFilesOnly : public Assimp::DefaultIOSystem {
 public:
  explicit OwnFilesOnly(const std::filesystem::path& mesh) {
    files_[named(mesh)] = mesh;
    for (const MeshReference& reference : referencesOf(mesh)) {
      if (!reference.file.empty()) files_[reference.named] = reference.file;
    }
  }

  bool Exists(const char* file) const override { return files_.contains(named(file)); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    const auto found = files_.find(named(file));
    const bool reads = mode != nullptr && mode[0] == 'r';
    return reads && found != files_.end() ? DefaultIOSystem::Open(found->second.c_str(), mode) : nullptr;
  }

 private:
  [[nodiscard]] static std::filesystem::path named(const std::filesystem::path& file) {
    return std::filesystem::absolute(file).lexically_normal();
  }
  std::map<std::filesystem::path, std::filesystem::path> files_;
};

void limit(int resource, std::uint64_t value) {
  const rlimit both{value, value};
  (void)::setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

/// With sanitizers the address space cannot be limited: they reserve large parts of it.
constexpr bool kCanLimitMemory =
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    false;
#else
    true;
#endif

struct ImportedMesh {
  std::vector<float> vertices;
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> colors;  ///< of each triangle
  bool has_colors = false;            ///< one of them is not kNoColor
  std::string error;
};

/// 0 to 255 of a part of a colour [0..1], 0 when it is not a number; `is_linear`: not yet sRGB (IEC
/// 61966-2-1).
std::uint32_t byteOf(float part, bool is_linear) {
  const float bounded = part > 0.0F ? std::min(part, 1.0F) : 0.0F;
  const float srgb = !is_linear              ? bounded
                     : bounded <= 0.0031308F ? 12.92F * bounded
                                             : 1.055F * std::pow(bounded, 1.0F / 2.4F) - 0.055F;
  return static_cast<std::uint32_t>(std::lround(255.0F * srgb));
}

std::uint32_t colorOf(const aiColor4D& color, bool is_linear) {
  return byteOf(color.r, is_linear) << 16U | byteOf(color.g, is_linear) << 8U | byteOf(color.b, is_linear);
}

/// What a material paints with, unless it is the importer's default or a texture, whose pixels are not read.
std::uint32_t colorOf(const aiMaterial& material, bool is_linear) {
  aiString name;
  aiColor4D color;
  if (material.Get(AI_MATKEY_NAME, name) == AI_SUCCESS && name == aiString(AI_DEFAULT_MATERIAL_NAME))
    return kNoColor;
  for (const aiTextureType texture : {aiTextureType_DIFFUSE, aiTextureType_BASE_COLOR})
    if (material.GetTextureCount(texture) > 0) return kNoColor;
  if (material.Get(AI_MATKEY_BASE_COLOR, color) != AI_SUCCESS &&
      material.Get(AI_MATKEY_COLOR_DIFFUSE, color) != AI_SUCCESS)
    return kNoColor;
  return colorOf(color, is_linear);
}

/// How the colours of a file are read.
struct ColorSource {
  const aiScene& scene;
  bool is_linear;      ///< as glTF demands
  bool has_materials;  ///< not an OBJ without its library, whose materials are the importer's grey
  bool is_stl;
};

/// The importer's, of facets that say no colour where others do; of 5 bits a channel no facet says it.
constexpr float kUncoloredStl = 0.6F;

std::uint32_t colorOfVertex(const aiColor4D& color, const ColorSource& source) {
  const bool is_none =
      source.is_stl && color.r == kUncoloredStl && color.g == kUncoloredStl && color.b == kUncoloredStl;
  return is_none ? kNoColor : colorOf(color, source.is_linear);
}

void collectMesh(const aiMesh& mesh, const ColorSource& source, const aiMatrix4x4& X_MN, double unit,
                 ImportedMesh& out) {
  const auto first = static_cast<std::uint32_t>(out.vertices.size() / 3);
  if (out.triangles.size() / 3 + mesh.mNumFaces > kMaxTriangles) {
    out.error = "has more than 60 million triangles";
    return;
  }
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D p = X_MN * mesh.mVertices[i];
    for (const float c : {p.x, p.y, p.z})
      out.vertices.push_back(static_cast<float>(static_cast<double>(c) * unit));
  }
  const bool is_painted = source.has_materials && mesh.mMaterialIndex < source.scene.mNumMaterials;
  const std::uint32_t painted =
      is_painted ? colorOf(*source.scene.mMaterials[mesh.mMaterialIndex], source.is_linear) : kNoColor;
  for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
    const aiFace& face = mesh.mFaces[i];
    if (face.mNumIndices != 3) continue;
    out.colors.push_back(mesh.HasVertexColors(0) ? colorOfVertex(mesh.mColors[0][face.mIndices[0]], source)
                                                 : painted);
    out.has_colors = out.has_colors || out.colors.back() != kNoColor;
    for (unsigned k = 0; k < 3; ++k) out.triangles.push_back(first + face.mIndices[k]);
  }
}

/// Frames: M of the whole mesh, P of the parent node, N of this node. A transform may also scale.
void collectNode(const ColorSource& source, const aiNode& node, const aiMatrix4x4& X_MP, double unit,
                 ImportedMesh& out) {
  const aiMatrix4x4 X_MN = X_MP * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes && out.error.empty(); ++i) {
    collectMesh(*source.scene.mMeshes[node.mMeshes[i]], source, X_MN, unit, out);
  }
  for (unsigned i = 0; i < node.mNumChildren && out.error.empty(); ++i) {
    collectNode(source, *node.mChildren[i], X_MN, unit, out);
  }
}

ImportedMesh importOctree(const std::string& file) {
  ImportedMesh out;
  const auto corners = readOctreeSurface(file);
  if (!corners) {
    out.error = corners.error().what;
    return out;
  }
  for (const Vector3f& p : *corners) {
    out.triangles.push_back(static_cast<std::uint32_t>(out.vertices.size() / 3));
    out.vertices.insert(out.vertices.end(), {p.x(), p.y(), p.z()});
  }
  return out;
}

ImportedMesh importFile(const std::string& file, double unit) {
  if (isOctree(file)) return importOctree(file);
  ImportedMesh out;
  Assimp::Importer importer;
  importer.SetIOHandler(new OwnFilesOnly(file));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(file, aiProcess_Triangulate | aiProcess_SortByPType);
  if (scene == nullptr) {
    out.error = importer.GetErrorString();
    return out;
  }
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  const std::vector<MeshReference> references = referencesOf(file);
  const bool has_library = std::any_of(references.begin(), references.end(), [](const MeshReference& other) {
    return other.only_colors && !other.file.empty();
  });
  const ColorSource source{*scene, ending == ".gltf" || ending == ".glb", ending != ".obj" || has_library,
                           ending == ".stl"};
  if (scene->mRootNode != nullptr) collectNode(source, *scene->mRootNode, aiMatrix4x4(), unit, out);
  return out;
}

bool writeAll(const void* data, std::size_t size) {
  const char* next = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(kImportDescriptor, next, size);
    if (written <= 0) return false;
    next += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

}  // namespace

int runImportChild(int argc, const char* const* argv) {
  if (argc != 4) return 2;
  const std::string file = argv[0];
  const double unit = std::strtod(argv[1], nullptr);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, std::strtoull(argv[2], nullptr, 10));
  if (kCanLimitMemory) limit(RLIMIT_AS, std::strtoull(argv[3], nullptr, 10));
  ImportedMesh mesh;
  try {
    mesh = importFile(file, unit);
  } catch (const std::bad_alloc&) {
    mesh = {};
    mesh.error = "reading it needs more memory than allowed for a file of its size";
  } catch (const std::exception& error) {
    mesh = {};
    mesh.error = error.what();
  }
  ImportHeader header;
  header.failed = mesh.error.empty() ? 0 : 1;
  header.vertices = mesh.vertices.size() / 3;
  header.triangles = mesh.triangles.size() / 3;
  header.colors = mesh.has_colors ? mesh.colors.size() : 0;
  header.text_bytes = mesh.error.size();
  const bool done = writeAll(&header, sizeof header) &&
                    writeAll(mesh.vertices.data(), mesh.vertices.size() * sizeof(float)) &&
                    writeAll(mesh.triangles.data(), mesh.triangles.size() * sizeof(std::uint32_t)) &&
                    writeAll(mesh.colors.data(), header.colors * sizeof(std::uint32_t)) &&
                    writeAll(mesh.error.data(), mesh.error.size());
  // _exit skips static destructors of other libraries, which are not needed
  ::_exit(done ? 0 : 3);
}

}  // namespace tenon::bake
