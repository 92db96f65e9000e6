#include <algorithm>
#include <cstdio>
#include <fstream>

#include <xxhash.h>

#include "server/bake/bake.h"
#include "server/bake/display_model.h"
#include "server/bake/mesh_references.h"
#include "server/bake/octree_file.h"

namespace tenon::bake {

namespace {

// Raised when a new release of this program computes other structures from the same meshes and options.
constexpr std::uint32_t kBakeVersion = 23;
// The same for display models.
constexpr std::uint32_t kDisplayVersion = 2;

/// Incremental hash of all inputs of a bake.
class ContentHash {
 public:
  ContentHash() : state_(XXH3_createState()) { XXH3_128bits_reset(state_); }
  ContentHash(const ContentHash&) = delete;
  ContentHash& operator=(const ContentHash&) = delete;
  ~ContentHash() { XXH3_freeState(state_); }

  template <typename T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    XXH3_128bits_update(state_, &value, sizeof value);
  }
  bool addFile(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::vector<char> block(1U << 20U);
    while (in) {
      in.read(block.data(), static_cast<std::streamsize>(block.size()));
      XXH3_128bits_update(state_, block.data(), static_cast<std::size_t>(in.gcount()));
    }
    return in.eof();
  }
  [[nodiscard]] std::string text() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_);
    char digits[33];
    std::snprintf(digits, sizeof digits, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                  static_cast<unsigned long long>(hash.low64));
    return digits;
  }

 private:
  XXH3_state_t* state_;
};

/// `colors`: also of files that change colours alone.
Result<void> addMeshes(ContentHash& hash, const std::vector<std::filesystem::path>& meshes, bool colors) {
  for (const auto& mesh : meshes) {
    if (!hash.addFile(mesh)) return fail(mesh.string() + ": cannot be read");
    // the names are in the mesh; a file that is missing is left to the import
    for (const auto& [named, file, only_colors] : referencesOf(mesh)) {
      if (only_colors && !colors) continue;
      std::error_code error;
      hash.add(file.empty() ? std::uint64_t{0} : std::uint64_t{std::filesystem::file_size(file, error)});
      if (!file.empty() && !hash.addFile(file)) return fail(file.string() + ": cannot be read");
    }
    hash.add(std::uint64_t{0});
  }
  return {};
}

Result<std::string> contentHash(const std::vector<std::filesystem::path>& meshes, double unit,
                                const BakeOptions& options) {
  ContentHash hash;
  hash.add(kBakeVersion);
  hash.add(unit);
  hash.add(options.voxel);
  hash.add(options.refinement);
  hash.add(options.point_spacing);
  hash.add(options.points);
  for (const RefineBox& region : options.refine) {
    for (const Vector3& corner : {region.box_M.min(), region.box_M.max()}) {
      for (const double c : corner) hash.add(c);
    }
  }
  if (const auto added = addMeshes(hash, meshes, false); !added) return tl::unexpected(added.error());
  return hash.text();
}

void append(TriangleMesh& whole, TriangleMesh part) {
  const auto first = static_cast<std::uint32_t>(whole.vertices.size());
  whole.vertices.insert(whole.vertices.end(), part.vertices.begin(), part.vertices.end());
  if (!whole.colors.empty() || !part.colors.empty()) {
    whole.colors.resize(whole.triangles.size(), kNoColor);
    part.colors.resize(part.triangles.size(), kNoColor);
    whole.colors.insert(whole.colors.end(), part.colors.begin(), part.colors.end());
  }
  for (const auto& [a, b, c] : part.triangles) whole.triangles.push_back({a + first, b + first, c + first});
  whole.notes.insert(whole.notes.end(), part.notes.begin(), part.notes.end());
}

Result<TriangleMesh> importAll(const std::vector<std::filesystem::path>& meshes, double unit,
                               const BakeProgress& progress = {}) {
  TriangleMesh whole;
  for (const auto& file : meshes) {
    if (progress && !progress(0.0, kReadingMeshes)) return fail("cancelled");
    auto part = importMesh(file, unit, progress);
    if (!part) return part;
    append(whole, std::move(*part));
  }
  return whole;
}

}  // namespace

Result<std::string> displayKey(const std::vector<std::filesystem::path>& meshes, double unit,
                               std::uint32_t uncolored) {
  ContentHash hash;
  hash.add(kDisplayVersion);
  hash.add(unit);
  hash.add(uncolored);
  if (const auto added = addMeshes(hash, meshes, true); !added) return tl::unexpected(added.error());
  return hash.text();
}

Result<std::vector<DisplayModel>> displayModelsOf(const std::vector<std::filesystem::path>& meshes,
                                                  double unit, std::uint32_t uncolored,
                                                  const BakeProgress& progress) {
  const auto whole = importAll(meshes, unit, progress);
  if (!whole) return tl::unexpected(whole.error());
  return displayModels(*whole, uncolored);
}

Result<structures::HapticStructures> bakeFiles(const std::vector<std::filesystem::path>& meshes, double unit,
                                               const BakeOptions& options, const BakeProgress& progress) {
  if (meshes.empty()) return fail("no mesh to bake");
  const auto hash = contentHash(meshes, unit, options);
  if (!hash) return tl::unexpected(hash.error());
  const auto whole = importAll(meshes, unit, progress);
  if (!whole) return tl::unexpected(whole.error());
  std::string source;
  for (const auto& file : meshes) source += (source.empty() ? "" : ", ") + file.filename().string();
  auto structures = bake(*whole, options, progress);
  if (!structures) return fail(source + ": " + structures.error().what);
  structures->info.source = source;
  structures->info.meshes = meshes;
  structures->info.unit = std::all_of(meshes.begin(), meshes.end(), isOctree) ? 1.0 : unit;
  structures->info.content_hash = *hash;
  return structures;
}

Result<std::filesystem::path> bakeCached(const std::vector<std::filesystem::path>& meshes, double unit,
                                         const BakeOptions& options,
                                         const std::filesystem::path& cache_folder,
                                         const BakeProgress& progress) {
  const auto hash = contentHash(meshes, unit, options);
  if (!hash) return tl::unexpected(hash.error());
  const std::filesystem::path file = cache_folder / (*hash + ".tenon");
  std::error_code error;
  // a damaged file in the cache is replaced
  if (std::filesystem::exists(file, error) && structures::openStructures(file)) return file;
  std::filesystem::create_directories(cache_folder, error);
  if (error) return fail(cache_folder.string() + ": cannot be created: " + error.message());
  const auto structures = bakeFiles(meshes, unit, options, progress);
  if (!structures) return tl::unexpected(structures.error());
  if (const auto ok = structures::writeStructures(file, *structures); !ok) return tl::unexpected(ok.error());
  return file;
}

}  // namespace tenon::bake
