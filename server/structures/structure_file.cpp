#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <type_traits>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "idl/types/output_files.h"
#include "server/structures/field_builder.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/shell_builder.h"
#include "server/structures/structure_bytes.h"
#include "server/structures/structure_checks.h"

namespace tenon::structures {

namespace {

constexpr std::array<char, 8> kMagic{'T', 'E', 'N', 'O', 'N', 'H', 'S', '\n'};
constexpr std::uint32_t kVersion = 11;
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
  kDilations,
  kFeaturePoints,
  kFeatureLeaves,
  kFeatureClusters,
  kFeatureLevels,
  kFeatureEdges,
  kFilled,
  kValleyIndex,
  kValleyBricks,
  kValleyCells,
  kValleyPlanes,
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
                                                           sizeof(float),
                                                           sizeof(ShellPoint),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellSphere),
                                                           sizeof(ShellLevel),
                                                           sizeof(FeatureEdge),
                                                           sizeof(FilledSpace),
                                                           sizeof(std::int32_t),
                                                           sizeof(ValleyBrick),
                                                           sizeof(std::uint32_t),
                                                           sizeof(ValleyPlane)};

struct FileHeader {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t byte_order = kByteOrder;
  std::uint64_t file_bytes = 0;
  std::uint64_t checksum = 0;  ///< XXH64 of the whole file with this field 0
  std::array<double, 3> p_MoFo_M{};
  double voxel = 0.0, band = 0.0, margin = 0.0, dilation = 0.0, slope = 1.0;
  std::array<std::int32_t, 3> bricks{};
  std::int32_t refinement = 1;
  std::array<std::uint64_t, kSections> first{}, count{};
  std::uint64_t triangles = 0, info_bricks = 0;
  double bake_seconds = 0.0, surface_area = 0.0, thin_area = 0.0, open_area = 0.0, unit = 1.0;
  std::array<double, 6> box_M{};
};
static_assert(std::is_trivially_copyable_v<FileHeader>);
static_assert(sizeof(ShellPoint) == 28 && sizeof(ShellSphere) == 24 && sizeof(ShellLevel) == 32 &&
              sizeof(FeatureEdge) == 64 && sizeof(FilledSpace) == 28 && sizeof(ValleyBrick) == 72 &&
              sizeof(ValleyPlane) == 16);

std::uint64_t aligned(std::uint64_t offset) { return (offset + kAlignment - 1) / kAlignment * kAlignment; }

/// Paths relative to the folder of the structure file, one per line, so that both may be moved together.
std::string meshesFrom(const std::filesystem::path& file, const StructureInfo& info) {
  std::error_code error;
  const auto folder = std::filesystem::weakly_canonical(std::filesystem::absolute(file), error).parent_path();
  std::string lines;
  for (const std::filesystem::path& mesh : info.meshes) {
    // a mesh that is a link keeps its own name: files that it refers to may be beside the link
    const auto named = std::filesystem::absolute(mesh).lexically_normal();
    const auto whole = std::filesystem::weakly_canonical(named.parent_path(), error) / named.filename();
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
          bytes(field.dilations),
          bytes(features.points()),
          bytes(features.leaves()),
          bytes(features.clusters()),
          bytes(features.levels()),
          bytes(structures.features.edges()),
          bytes(info.filled),
          bytes(field.valley_index),
          bytes(field.valley_bricks),
          bytes(field.valley_cells),
          bytes(field.valley_planes)};
}

FileHeader headerOf(const HapticStructures& structures) {
  const DistanceField::Layout& field = structures.field.layout();
  const StructureInfo& info = structures.info;
  FileHeader header;
  Vector3::Map(header.p_MoFo_M.data()) = field.p_MoFo_M;
  header.voxel = field.voxel;
  header.band = field.band;
  header.margin = field.margin;
  header.dilation = field.dilation;
  header.slope = field.slope;
  header.bricks = field.bricks;
  header.refinement = field.refinement;
  header.triangles = info.triangles;
  header.info_bricks = info.bricks;
  header.bake_seconds = info.bake_seconds;
  header.surface_area = info.surface_area;
  header.thin_area = info.thin_area;
  header.open_area = info.open_area;
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

/// Copies a section: an array of its own, in huge pages, that no other process can change or cut off.
template <typename T>
void copySection(std::span<const std::byte> file, const FileHeader& header, FileSection which,
                 HugeVector<T>& to) {
  const auto elements = section<T>(file, header, which);
  to.assign(elements.begin(), elements.end());
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

bool infoIsFinite(const FileHeader& header, const std::vector<FilledSpace>& filled) {
  const auto finite = [](double number) { return std::isfinite(number); };
  for (const FilledSpace& space : filled)
    if (!finite(space.wall_area) || !std::all_of(space.low.begin(), space.low.end(), finite) ||
        !std::all_of(space.high.begin(), space.high.end(), finite))
      return false;
  return finite(header.bake_seconds) && finite(header.surface_area) && finite(header.thin_area) &&
         finite(header.open_area) && finite(header.unit) &&
         std::all_of(header.box_M.begin(), header.box_M.end(), finite);
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

/// The bytes of a structure file. Fails with what makes the structures unsound.
Result<std::vector<std::uint8_t>> bytesOf(const HapticStructures& structures, double bake_seconds,
                                          const std::string& meshes) {
  if (const auto problem = problemOf(structures.field.layout())) return fail("field " + *problem);
  if (const auto problem = problemOf(structures.shell.layout())) return fail("pointshell " + *problem);
  const FeatureShell& features = structures.features;
  if (const auto problem = problemOf(features.points().layout(), features.edges()))
    return fail("feature shell " + *problem);
  FileHeader header = headerOf(structures);
  header.bake_seconds = bake_seconds;
  const auto sections = sectionsOf(structures, meshes);
  std::uint64_t offset = sizeof header;
  for (std::size_t i = 0; i < kSections; ++i) {
    header.first[i] = offset = aligned(offset);
    header.count[i] = sections[i].size() / kElementBytes[i];
    offset += sections[i].size();
  }
  header.file_bytes = offset;
  std::vector<std::uint8_t> bytes(offset);
  for (std::size_t i = 0; i < kSections; ++i) {
    if (sections[i].empty()) continue;
    std::memcpy(bytes.data() + header.first[i], sections[i].data(), sections[i].size());
  }
  header.checksum = checksumOf(header, std::as_bytes(std::span(bytes).subspan(sizeof header)));
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

}  // namespace

Result<void> writeStructures(const std::filesystem::path& file, const HapticStructures& structures) {
  const auto bytes = bytesOf(structures, structures.info.bake_seconds, meshesFrom(file, structures.info));
  if (!bytes)
    return fail(file.string() + ": not written, since it could not be read again: its " + bytes.error().what);

  const bool in_place = isWrittenInPlace(file);
  const std::filesystem::path part =
      in_place ? file : std::filesystem::path(file.string() + ".part" + std::to_string(::getpid()));
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes->data()), static_cast<std::streamsize>(bytes->size()));
  out.close();
  std::error_code error;
  if (out && !in_place) std::filesystem::rename(part, file, error);
  if (!out || error) {
    std::error_code ignored;
    if (!in_place) std::filesystem::remove(part, ignored);
    return fail(file.string() + ": cannot be written" + (error ? ": " + error.message() : std::string{}));
  }
  return {};
}

Result<std::vector<std::uint8_t>> structureBytes(const HapticStructures& structures) {
  auto bytes = bytesOf(structures, 0.0, {});
  if (!bytes)
    return fail("the structures of " + structures.info.source + " cannot be kept: their " +
                bytes.error().what);
  return bytes;
}

Result<std::shared_ptr<const HapticStructures>> openStructures(const std::filesystem::path& file) {
  const auto mapping = FileMapping::open(file);
  if (!mapping) return fail(file.string() + ": cannot be read, or is empty");
  return readStructures(mapping->bytes(), file);
}

Result<std::shared_ptr<const HapticStructures>> readStructures(std::span<const std::byte> bytes,
                                                               const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto header = readHeader(name, bytes);
  if (!header) return tl::unexpected(header.error());

  FieldStorage field;
  field.layout.p_MoFo_M = Vector3::Map(header->p_MoFo_M.data());
  field.layout.voxel = header->voxel;
  field.layout.band = header->band;
  field.layout.margin = header->margin;
  field.layout.dilation = header->dilation;
  field.layout.slope = header->slope;
  field.layout.bricks = header->bricks;
  field.layout.refinement = header->refinement;
  copySection(bytes, *header, kIndex, field.index);
  copySection(bytes, *header, kSamples, field.samples);
  copySection(bytes, *header, kFar, field.far);
  copySection(bytes, *header, kDilations, field.dilations);
  copySection(bytes, *header, kValleyIndex, field.valley_index);
  copySection(bytes, *header, kValleyBricks, field.valley_bricks);
  copySection(bytes, *header, kValleyCells, field.valley_cells);
  copySection(bytes, *header, kValleyPlanes, field.valley_planes);
  ShellStorage shell;
  copySection(bytes, *header, kPoints, shell.points);
  copySection(bytes, *header, kLeaves, shell.leaves);
  copySection(bytes, *header, kClusters, shell.clusters);
  copySection(bytes, *header, kLevels, shell.levels);
  FeatureStorage features;
  copySection(bytes, *header, kFeaturePoints, features.points.points);
  copySection(bytes, *header, kFeatureLeaves, features.points.leaves);
  copySection(bytes, *header, kFeatureClusters, features.points.clusters);
  copySection(bytes, *header, kFeatureLevels, features.points.levels);
  copySection(bytes, *header, kFeatureEdges, features.edges);
  const auto damaged = [&name](const std::string& what) {
    return fail(name + ": its " + what + "; bake it again");
  };
  if (const auto problem = problemOf(shell.layout())) return damaged("pointshell " + *problem);
  if (const auto problem = problemOf(features.points.layout(), features.edges))
    return damaged("feature shell " + *problem);
  const auto spaces = section<FilledSpace>(bytes, *header, kFilled);
  std::vector<FilledSpace> filled(spaces.begin(), spaces.end());
  if (!infoIsFinite(*header, filled)) return damaged("header has a number that is not finite");
  auto structures = std::make_shared<HapticStructures>();
  const bool has_field = !field.index.empty() || !field.samples.empty() || !field.far.empty();
  if (has_field) structures->field = makeField(std::move(field));
  if (const auto problem = problemOf(structures->field.layout())) return damaged("field " + *problem);
  structures->shell = makeShell(std::move(shell));
  structures->features = makeFeatureShell(std::move(features));
  StructureInfo& info = structures->info;
  info.source = text(bytes, *header, kSource);
  info.content_hash = text(bytes, *header, kContentHash);
  info.notes = text(bytes, *header, kNotes);
  info.meshes = meshesOf(file, text(bytes, *header, kMeshes));
  info.triangles = header->triangles;
  info.bricks = header->info_bricks;
  info.bake_seconds = header->bake_seconds;
  info.surface_area = header->surface_area;
  info.thin_area = header->thin_area;
  info.open_area = header->open_area;
  info.unit = header->unit;
  info.filled = std::move(filled);
  info.box_M = {Vector3::Map(header->box_M.data()), Vector3::Map(header->box_M.data() + 3)};
  return structures;
}

}  // namespace tenon::structures
