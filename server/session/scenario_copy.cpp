#include "server/session/scenario_copy.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/record/compression.h"
#include "idl/types/hash.h"
#include "server/bake/mesh_references.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "scenario/";
constexpr std::string_view kFilesMetadata = "tenon scenario files";
constexpr std::string_view kScenario = "scenario";  // in the metadata: the name of the YAML file
constexpr std::string_view kHeld = "file ";         // and before the name of a file that is held
constexpr std::string_view kMissing = "missing ";   // and of one that is not; the values are size and hash

/// A file of the scenario, and what it is called there: absolute and normal.
struct NamedFile {
  fs::path named, file;
  std::uintmax_t size = 0;  ///< [bytes]
};

/// The YAML file first, each file once.
Result<std::vector<NamedFile>> filesOf(const game_control::ScenarioFile& scenario) {
  std::vector<NamedFile> files;
  std::set<fs::path> known;
  const auto add = [&](const fs::path& named, const fs::path& file) -> Result<void> {
    std::error_code error;
    const fs::path whole = fs::absolute(named, error).lexically_normal();
    if (!known.insert(whole).second) return {};
    const std::uintmax_t size = fs::file_size(file, error);
    if (error) return fail(fmt::format("{}: cannot be read ({})", file.string(), error.message()));
    files.push_back({whole, file, size});
    return {};
  };
  if (auto added = add(scenario.path, scenario.path); !added) return fail(added.error().what);
  for (const game_control::ScenarioObject& object : scenario.objects) {
    for (const game_control::MeshSource& mesh : object.meshes) {
      if (mesh.shape || !mesh.part.empty()) continue;
      if (auto added = add(mesh.file, mesh.file); !added) return fail(added.error().what);
      for (const bake::MeshReference& reference : bake::referencesOf(mesh.file))
        if (!reference.file.empty())
          if (auto added = add(reference.named, reference.file); !added) return fail(added.error().what);
    }
  }
  return files;
}

/// The folder that contains the folder of the scenario and all files, so that their names in the journal say
/// where they are relative to each other, and what the scenario's folder is called.
fs::path commonFolder(const std::vector<NamedFile>& files) {
  fs::path common = files.front().named.parent_path().parent_path();
  for (const NamedFile& file : files) {
    const auto isBelow = [&](const fs::path& folder) {
      return std::mismatch(folder.begin(), folder.end(), file.named.begin(), file.named.end()).first ==
             folder.end();
    };
    while (!isBelow(common) && common.has_relative_path()) common = common.parent_path();
  }
  return common;
}

Result<std::vector<std::uint8_t>> bytesOf(const NamedFile& file) {
  std::ifstream in(file.file, std::ios::binary);
  std::vector<std::uint8_t> bytes(file.size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!in) return fail(file.file.string() + ": cannot be read");
  return bytes;
}

constexpr std::size_t kBlock = 1U << 20U;  // [bytes] of which a hash is made in turn

std::string sizeAndHash(std::uintmax_t size, const StateHash& hash) {
  return fmt::format("{} {:016x}", size, hash.value());
}
std::string sizeAndHash(std::span<const std::uint8_t> bytes) {
  StateHash hash;
  for (std::size_t at = 0; at < bytes.size(); at += kBlock) {
    const auto block = bytes.subspan(at, std::min(kBlock, bytes.size() - at));
    hash.add(std::string_view(reinterpret_cast<const char*>(block.data()), block.size()));
  }
  return sizeAndHash(bytes.size(), hash);
}
/// Of a file of any size, a block at a time.
Result<std::string> sizeAndHash(const NamedFile& file) {
  std::ifstream in(file.file, std::ios::binary);
  StateHash hash;
  std::string block(kBlock, '\0');
  for (std::uintmax_t left = file.size; left > 0;) {
    block.resize(static_cast<std::size_t>(std::min<std::uintmax_t>(kBlock, left)));
    if (!in.read(block.data(), static_cast<std::streamsize>(block.size())))
      return fail(file.file.string() + ": cannot be read");
    hash.add(std::string_view(block));
    left -= block.size();
  }
  return sizeAndHash(file.size, hash);
}

/// Whether a name from a journal is that of a file below the folder it is unpacked in.
bool isBelow(const fs::path& name) {
  return !name.empty() && name.is_relative() &&
         std::none_of(name.begin(), name.end(), [](const fs::path& part) { return part == ".."; });
}

const std::map<std::string, std::string>* listOf(const record::McapReader& journal) {
  const auto found = journal.metadata().find(std::string(kFilesMetadata));
  return found == journal.metadata().end() ? nullptr : &found->second;
}

/// Returns size and hash of what it wrote; at most `most` bytes.
Result<std::string> unpack(const record::McapAttachment& attachment, const fs::path& file,
                           std::uintmax_t& most) {
  const auto bytes = record::decompress(attachment.data, most);
  if (!bytes) return fail(fmt::format("its copy of {} {}", attachment.name, bytes.error().what));
  most -= bytes->size();
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes->data()), static_cast<std::streamsize>(bytes->size()));
  out.close();
  if (!out) return fail(file.string() + ": cannot be written");
  return sizeAndHash(*bytes);
}

}  // namespace

Result<void> addScenarioFiles(record::McapWriter& journal, const game_control::ScenarioFile& scenario,
                              std::uintmax_t most_bytes) {
  auto files = filesOf(scenario);
  if (!files) return fail(files.error().what);
  const fs::path common = commonFolder(*files);
  const auto nameOf = [&](const NamedFile& file) { return file.named.lexically_relative(common).string(); };
  std::map<std::string, std::string> list{{std::string(kScenario), nameOf(files->front())}};
  // the scenario itself, then the smallest
  std::stable_sort(std::next(files->begin()), files->end(),
                   [](const NamedFile& a, const NamedFile& b) { return a.size < b.size; });
  std::uintmax_t held = 0;
  for (const NamedFile& file : *files) {
    if (file.size > most_bytes - held) {
      auto said = sizeAndHash(file);
      if (!said) return fail(said.error().what);
      list[std::string(kMissing) + nameOf(file)] = std::move(*said);
      continue;
    }
    const auto bytes = bytesOf(file);
    if (!bytes) return fail(bytes.error().what);
    held += bytes->size();
    list[std::string(kHeld) + nameOf(file)] = sizeAndHash(*bytes);
    const auto compressed = record::compress(*bytes);
    if (!compressed) return fail(file.file.string() + ": " + compressed.error().what);
    const auto added =
        journal.addAttachment(std::string(kPrefix) + nameOf(file), record::kCompressedType, *compressed);
    if (!added) return added;
  }
  return journal.addMetadata(kFilesMetadata, list);
}

Result<fs::path> unpackScenario(const record::McapReader& journal, const fs::path& folder) {
  const auto* const list = listOf(journal);
  if (list == nullptr || !list->contains(std::string(kScenario))) return fail("has no copy of its scenario");
  std::vector<std::string> missing;
  for (const auto& [key, text] : *list) {
    if (!key.starts_with(kMissing)) continue;
    const std::size_t space = text.find(' ');
    missing.push_back(fmt::format("{} ({} bytes, hash {})", key.substr(kMissing.size()),
                                  text.substr(0, space), text.substr(std::min(space, text.size() - 1) + 1)));
  }
  if (!missing.empty())
    return fail(fmt::format("does not hold all of its scenario, which was too large: missing are {}",
                            fmt::join(missing, ", ")));
  std::map<std::string, std::string> unpacked;
  std::uintmax_t most = kMostScenarioBytes;
  for (const record::McapAttachment& attachment : journal.attachments()) {
    if (!attachment.name.starts_with(kPrefix)) continue;
    const std::string name = attachment.name.substr(kPrefix.size());
    if (!isBelow(name)) return fail(fmt::format("names a file outside of its scenario: {}", attachment.name));
    auto done = unpack(attachment, folder / name, most);
    if (!done) return fail(done.error().what);
    unpacked[name] = std::move(*done);
  }
  for (const auto& [key, text] : *list) {
    if (!key.starts_with(kHeld)) continue;
    const auto found = unpacked.find(key.substr(kHeld.size()));
    if (found == unpacked.end() || found->second != text)
      return fail(
          fmt::format("is damaged: its copy of {} is not what was written", key.substr(kHeld.size())));
  }
  const fs::path scenario = list->at(std::string(kScenario));
  std::error_code error;
  if (!isBelow(scenario) || !fs::is_regular_file(folder / scenario, error))
    return fail("is damaged: it lacks the scenario that it names");
  return folder / scenario;
}

Result<UnpackedScenario> UnpackedScenario::of(const fs::path& journal) {
  const auto reader = record::McapReader::open(journal);
  if (!reader) return fail(reader.error().what);
  std::error_code error;
  std::string name = (fs::temp_directory_path(error) / "tenon-scenario-XXXXXX").string();
  if (error || mkdtemp(name.data()) == nullptr) return fail(name + ": this folder cannot be made");
  UnpackedScenario unpacked{fs::path(name)};
  auto scenario = unpackScenario(*reader, unpacked.folder_);
  if (!scenario) return fail(fmt::format("{}: {}", journal.string(), scenario.error().what));
  unpacked.scenario_ = std::move(*scenario);
  return unpacked;
}

UnpackedScenario::~UnpackedScenario() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

}  // namespace tenon::session
