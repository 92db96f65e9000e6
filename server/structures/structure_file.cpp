#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "server/structures/haptic_structures.h"

namespace tenon::structures {

namespace {

constexpr std::array<char, 8> kMagic{'T', 'E', 'N', 'O', 'N', 'H', 'S', '\n'};
constexpr std::uint32_t kVersion = 4;
constexpr std::uint32_t kByteOrder = 0x01020304U;
constexpr std::size_t kAlignment = 64;

/// The arrays of a file, in this order; each begins at a multiple of kAlignment.
enum FileSection : std::size_t {
  kIndex,
  kSamples,
  kFar,
  kPoints,
  kLeaves,
  kClusters,
  kLevels,
  kSource,
  kContentHash,
  kNotes,
  kMeshes,
  kFeaturePoints,
  kFeatureLeaves,
  kFeatureClusters,
  kFeatureLevels,
  kFeatureEdges,
  kSections
};
constexpr std::array<std::size_t, kSections> kElementBytes{sizeof(DistanceField::Entry),
                                                           sizeof(std::int16_t),
                                                           sizeof(std::int16_t),
                                                           sizeof(ShellPoint),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellLevel),
                                                           1,
                                                           1,
                                                           1,
                                                           1,
                                                           sizeof(ShellPoint),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellLevel),
                                                           sizeof(FeatureEdge)};

struct FileHeader {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t byte_order = kByteOrder;
  std::uint64_t file_bytes = 0;
  std::uint64_t checksum = 0;  ///< XXH64 of the whole file with this field 0
  std::array<double, 3> p_MoFo_M{};
  double voxel = 0.0, band = 0.0, margin = 0.0;
  std::array<std::int32_t, 3> bricks{};
  std::int32_t refinement = 1;
  std::array<std::uint64_t, kSections> first{}, count{};
  std::uint64_t triangles = 0, info_bricks = 0;
  double bake_seconds = 0.0, surface_area = 0.0, unit = 1.0;
  std::array<double, 6> box_M{};
};
static_assert(std::is_trivially_copyable_v<FileHeader>);
static_assert(sizeof(ShellPoint) == 28 && sizeof(ShellSphere) == 24 && sizeof(ShellLevel) == 32 &&
              sizeof(FeatureEdge) == 36);

std::uint64_t aligned(std::uint64_t offset) { return (offset + kAlignment - 1) / kAlignment * kAlignment; }

/// Paths relative to the folder of the structure file, one per line, so that both may be moved together.
std::string meshesFrom(const std::filesystem::path& file, const StructureInfo& info) {
  std::error_code error;
  const auto folder = std::filesystem::weakly_canonical(std::filesystem::absolute(file), error).parent_path();
  std::string lines;
  for (const std::filesystem::path& mesh : info.meshes) {
    const auto whole = std::filesystem::weakly_canonical(std::filesystem::absolute(mesh), error);
    lines += whole.lexically_relative(folder).generic_string() + "\n";
  }
  return lines;
}

std::vector<std::filesystem::path> meshesOf(const std::filesystem::path& file, const std::string& lines) {
  std::vector<std::filesystem::path> meshes;
  for (std::size_t begin = 0; begin < lines.size();) {
    const std::size_t end = std::min(lines.find('\n', begin), lines.size());
    meshes.push_back((file.parent_path() / lines.substr(begin, end - begin)).lexically_normal());
    begin = end + 1;
  }
  return meshes;
}

/// The bytes of each section.
std::array<std::span<const std::byte>, kSections> sectionsOf(const HapticStructures& structures,
                                                             const std::string& meshes) {
  const auto bytes = [](const auto& list) { return std::as_bytes(std::span(list.data(), list.size())); };
  const DistanceField::Layout& field = structures.field.layout();
  const Pointshell& shell = structures.shell;
  const Pointshell& features = structures.features.points();
  const StructureInfo& info = structures.info;
  return {bytes(field.index),
          bytes(field.samples),
          bytes(field.far),
          bytes(shell.points()),
          bytes(shell.leaves()),
          bytes(shell.clusters()),
          bytes(shell.levels()),
          bytes(info.source),
          bytes(info.content_hash),
          bytes(info.notes),
          bytes(meshes),
          bytes(features.points()),
          bytes(features.leaves()),
          bytes(features.clusters()),
          bytes(features.levels()),
          bytes(structures.features.edges())};
}

FileHeader headerOf(const HapticStructures& structures) {
  const DistanceField::Layout& field = structures.field.layout();
  const StructureInfo& info = structures.info;
  FileHeader header;
  Vector3::Map(header.p_MoFo_M.data()) = field.p_MoFo_M;
  header.voxel = field.voxel;
  header.band = field.band;
  header.margin = field.margin;
  header.bricks = field.bricks;
  header.refinement = field.refinement;
  header.triangles = info.triangles;
  header.info_bricks = info.bricks;
  header.bake_seconds = info.bake_seconds;
  header.surface_area = info.surface_area;
  header.unit = info.unit;
  Vector3::Map(header.box_M.data()) = info.box_M.min();
  Vector3::Map(header.box_M.data() + 3) = info.box_M.max();
  return header;
}

std::uint64_t checksumOf(FileHeader header, std::span<const std::byte> rest) {
  header.checksum = 0;
  XXH64_state_t* state = XXH64_createState();
  XXH64_reset(state, 0);
  XXH64_update(state, &header, sizeof header);
  XXH64_update(state, rest.data(), rest.size());
  const std::uint64_t checksum = XXH64_digest(state);
  XXH64_freeState(state);
  return checksum;
}

/// A file mapped for reading; unmapped with its last reference.
class FileMapping {
 public:
  static std::shared_ptr<const FileMapping> open(const std::filesystem::path& file) {
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return nullptr;
    struct stat status {};
    void* memory = MAP_FAILED;
    std::size_t size = 0;
    if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
      size = static_cast<std::size_t>(status.st_size);
      memory = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    ::close(descriptor);
    if (memory == MAP_FAILED) return nullptr;
    return std::shared_ptr<const FileMapping>(new FileMapping(static_cast<const std::byte*>(memory), size));
  }
  FileMapping(const FileMapping&) = delete;
  FileMapping& operator=(const FileMapping&) = delete;
  ~FileMapping() { ::munmap(const_cast<std::byte*>(memory_), size_); }

  [[nodiscard]] std::span<const std::byte> bytes() const { return {memory_, size_}; }

 private:
  FileMapping(const std::byte* memory, std::size_t size) : memory_(memory), size_(size) {}
  const std::byte* memory_;
  std::size_t size_;
};

template <typename T>
std::span<const T> section(std::span<const std::byte> file, const FileHeader& header, FileSection which) {
  return {reinterpret_cast<const T*>(file.data() + header.first[which]), header.count[which]};
}

std::string text(std::span<const std::byte> file, const FileHeader& header, FileSection which) {
  const auto letters = section<char>(file, header, which);
  return {letters.begin(), letters.end()};
}

bool sectionsFit(const FileHeader& header) {
  for (std::size_t i = 0; i < kSections; ++i) {
    if (header.first[i] % kAlignment != 0 || header.first[i] > header.file_bytes) return false;
    if (header.count[i] > (header.file_bytes - header.first[i]) / kElementBytes[i]) return false;
  }
  return true;
}

/// Whether all sizes are sensible and every index of the field is within its array.
bool fieldIsValid(const DistanceField::Layout& field) {
  if (!(field.voxel > 0.0) || !std::isfinite(field.voxel) || !field.p_MoFo_M.allFinite()) return false;
  if (!(field.band > 0.0) || !(field.margin >= 0.0) || field.refinement < 1 || field.refinement > 64)
    return false;
  std::uint64_t coarse = 1;
  for (const std::int32_t count : field.bricks) {
    if (count < 1 || count > 1'000'000) return false;
    coarse *= static_cast<std::uint64_t>(count);
  }
  if (coarse > field.index.size() || field.far.size() != coarse) return false;
  if (field.samples.size() % DistanceField::kBrickSamples != 0) return false;
  // queries gather pairs of numbers at byte offsets of 31 bits
  constexpr std::size_t kMaxBytes = std::numeric_limits<std::int32_t>::max();
  if (field.samples.size_bytes() > kMaxBytes || field.far.size_bytes() > kMaxBytes / 2) return false;
  if (field.far.size() < 2 || field.index.size() > kMaxBytes / 2) return false;
  const std::size_t bricks = field.samples.size() / DistanceField::kBrickSamples;
  const auto cubed = static_cast<std::size_t>(field.refinement * field.refinement * field.refinement);
  for (std::size_t i = 0; i < field.index.size(); ++i) {
    const DistanceField::Entry entry = field.index[i];
    if (entry < DistanceField::kFarInside) return false;
    if (entry < 0) continue;
    if (entry < DistanceField::kRefined) {
      if (static_cast<std::size_t>(entry) >= bricks) return false;
      continue;
    }
    const auto children = static_cast<std::size_t>(entry - DistanceField::kRefined);
    if (i >= coarse || children < coarse || children + cubed >= field.index.size()) return false;
    const DistanceField::Entry own = field.index[children + cubed];
    if (own < 0 || own >= DistanceField::kRefined) return false;
  }
  return true;
}

/// Whether `spheres` hold the elements `first` to `first` + `count` - 1 of the next finer list in order and
/// without gaps, at most `most` each.
bool tile(std::span<const ShellSphere> spheres, std::uint64_t first, std::uint64_t count,
          std::uint32_t most) {
  std::uint64_t next = first;
  for (const ShellSphere& sphere : spheres) {
    if (sphere.first != next || sphere.count > most) return false;
    next += sphere.count;
  }
  return next == first + count;
}

/// What is wrong with a shell, or nothing. Levels, clusters and leaves must tile their points in order: a
/// query takes a point's leaf and its area of a level by position.
std::optional<std::string> problemOf(const Pointshell::Layout& shell) {
  std::uint64_t points = 0;
  std::uint64_t leaves = 0;
  std::uint64_t clusters = 0;
  for (const ShellLevel& level : shell.levels) {
    if (level.first_point != points || level.first_leaf != leaves || level.first_cluster != clusters)
      return "its levels do not follow one another";
    points += level.point_count;
    leaves += level.leaf_count;
    clusters += level.cluster_count;
    if (points > shell.points.size() || leaves > shell.leaves.size() || clusters > shell.clusters.size())
      return "its levels have an index out of range";
    if (!tile(shell.leaves.subspan(level.first_leaf, level.leaf_count), level.first_point, level.point_count,
              Pointshell::kLeafPoints))
      return "the leaves of a level do not hold each of its points once";
    if (!tile(shell.clusters.subspan(level.first_cluster, level.cluster_count), level.first_leaf,
              level.leaf_count, Pointshell::kClusterLeaves))
      return "the clusters of a level do not hold each of its leaves once";
  }
  if (points != shell.points.size() || leaves != shell.leaves.size() || clusters != shell.clusters.size())
    return "its levels do not hold each point once";
  const auto finite = [](const ShellPoint& point) {
    return point.p_MP.allFinite() && point.inward_M.allFinite() && std::isfinite(point.area);
  };
  if (!std::all_of(shell.points.begin(), shell.points.end(), finite)) return "a point is not finite";
  return {};
}

/// What is wrong with features, or nothing: their points are those of a shell, each has an edge.
std::optional<std::string> problemOf(const Pointshell::Layout& points, std::span<const FeatureEdge> edges) {
  if (const auto problem = problemOf(points)) return problem;
  if (edges.size() != points.points.size()) return "there is not an edge for each point";
  const auto finite = [](const FeatureEdge& edge) {
    return edge.half_M.allFinite() && edge.into_M[0].allFinite() && edge.into_M[1].allFinite();
  };
  if (!std::all_of(edges.begin(), edges.end(), finite)) return "an edge is not finite";
  return {};
}

Result<FileHeader> readHeader(const std::string& name, std::span<const std::byte> bytes) {
  FileHeader header;
  if (bytes.size() < sizeof header) return fail(name + ": not a structure file (too short)");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.magic != kMagic) return fail(name + ": not a structure file");
  if (header.byte_order != kByteOrder) return fail(name + ": written on a machine with another byte order");
  if (header.version != kVersion) {
    return fail(name + ": version " + std::to_string(header.version) +
                " of the structure file format, this program reads version " + std::to_string(kVersion) +
                "; bake it again");
  }
  if (header.file_bytes != bytes.size()) {
    return fail(name + ": has " + std::to_string(bytes.size()) + " bytes where its header states " +
                std::to_string(header.file_bytes) + ": truncated or damaged; bake it again");
  }
  if (checksumOf(header, bytes.subspan(sizeof header)) != header.checksum) {
    return fail(name + ": wrong checksum: the file is damaged; bake it again");
  }
  if (!sectionsFit(header))
    return fail(name + ": a section reaches beyond the end of the file; bake it again");
  return header;
}

}  // namespace

Result<void> writeStructures(const std::filesystem::path& file, const HapticStructures& structures) {
  FileHeader header = headerOf(structures);
  const std::string meshes = meshesFrom(file, structures.info);
  const auto sections = sectionsOf(structures, meshes);
  std::uint64_t offset = sizeof header;
  for (std::size_t i = 0; i < kSections; ++i) {
    header.first[i] = offset = aligned(offset);
    header.count[i] = sections[i].size() / kElementBytes[i];
    offset += sections[i].size();
  }
  header.file_bytes = offset;
  std::vector<std::byte> rest(offset - sizeof header);
  for (std::size_t i = 0; i < kSections; ++i) {
    if (sections[i].empty()) continue;
    std::memcpy(rest.data() + (header.first[i] - sizeof header), sections[i].data(), sections[i].size());
  }
  header.checksum = checksumOf(header, rest);

  const std::filesystem::path part = file.string() + ".part" + std::to_string(::getpid());
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(&header), sizeof header);
  out.write(reinterpret_cast<const char*>(rest.data()), static_cast<std::streamsize>(rest.size()));
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(part, file, error);
  if (!out || error) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    return fail(file.string() + ": cannot be written" + (error ? ": " + error.message() : std::string{}));
  }
  return {};
}

Result<std::shared_ptr<const HapticStructures>> openStructures(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto mapping = FileMapping::open(file);
  if (!mapping) return fail(name + ": cannot be read, or is empty");
  const auto bytes = mapping->bytes();
  const auto header = readHeader(name, bytes);
  if (!header) return tl::unexpected(header.error());

  DistanceField::Layout field;
  field.p_MoFo_M = Vector3::Map(header->p_MoFo_M.data());
  field.voxel = header->voxel;
  field.band = header->band;
  field.margin = header->margin;
  field.bricks = header->bricks;
  field.refinement = header->refinement;
  field.index = section<DistanceField::Entry>(bytes, *header, kIndex);
  field.samples = section<std::int16_t>(bytes, *header, kSamples);
  field.far = section<std::int16_t>(bytes, *header, kFar);
  const Pointshell::Layout shell{
      section<ShellPoint>(bytes, *header, kPoints), section<ShellSphere>(bytes, *header, kLeaves),
      section<ShellSphere>(bytes, *header, kClusters), section<ShellLevel>(bytes, *header, kLevels)};
  if (!field.index.empty() && !fieldIsValid(field))
    return fail(name + ": its field has an index out of range; bake it again");
  if (const auto problem = problemOf(shell))
    return fail(name + ": its pointshell is damaged, " + *problem + "; bake it again");
  const Pointshell::Layout features{section<ShellPoint>(bytes, *header, kFeaturePoints),
                                    section<ShellSphere>(bytes, *header, kFeatureLeaves),
                                    section<ShellSphere>(bytes, *header, kFeatureClusters),
                                    section<ShellLevel>(bytes, *header, kFeatureLevels)};
  const auto edges = section<FeatureEdge>(bytes, *header, kFeatureEdges);
  if (const auto problem = problemOf(features, edges))
    return fail(name + ": its features are damaged, " + *problem + "; bake it again");

  auto structures = std::make_shared<HapticStructures>();
  if (!field.index.empty()) structures->field = DistanceField(field, mapping);
  structures->shell = Pointshell(shell, mapping);
  structures->features = FeatureShell(Pointshell(features, mapping), edges, mapping);
  StructureInfo& info = structures->info;
  info.source = text(bytes, *header, kSource);
  info.content_hash = text(bytes, *header, kContentHash);
  info.notes = text(bytes, *header, kNotes);
  info.meshes = meshesOf(file, text(bytes, *header, kMeshes));
  info.triangles = header->triangles;
  info.bricks = header->info_bricks;
  info.bake_seconds = header->bake_seconds;
  info.surface_area = header->surface_area;
  info.unit = header->unit;
  info.box_M = {Vector3::Map(header->box_M.data()), Vector3::Map(header->box_M.data() + 3)};
  return structures;
}

}  // namespace tenon::structures
