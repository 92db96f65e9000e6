#include "server/game_control/scenario.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <system_error>

#include "server/game_control/scenario_reader.h"

namespace tenon::game_control {
namespace {

constexpr std::uintmax_t kLargestFile = 1 << 20;  // [bytes] a hundred times the largest scenario

template <typename Container>
std::uint32_t indexNamed(const Container& container, std::string_view name) {
  const auto found =
      std::find_if(container.begin(), container.end(), [&](const auto& item) { return item.name == name; });
  return found == container.end() ? ObjectId::kNone : static_cast<std::uint32_t>(found - container.begin());
}

}  // namespace

ObjectId ScenarioFile::objectNamed(std::string_view object) const {
  return ObjectId{indexNamed(objects, object)};
}

HandId ScenarioFile::handNamed(std::string_view hand) const { return HandId{indexNamed(hands, hand)}; }

int ScenarioFile::pairOf(ObjectId a, ObjectId b) const {
  const auto found = std::find_if(pairs.begin(), pairs.end(), [&](const ScenarioPair& pair) {
    return (pair.a == a && pair.b == b) || (pair.a == b && pair.b == a);
  });
  return found == pairs.end() ? -1 : static_cast<int>(found - pairs.begin());
}

int ScenarioFile::signalNamed(std::string_view signal) const {
  const auto found = std::find(signals.begin(), signals.end(), signal);
  return found == signals.end() ? -1 : static_cast<int>(found - signals.begin());
}

namespace {

/// A name without a folder may also be that of a shipped scenario.
std::filesystem::path located(const std::filesystem::path& path) {
  std::error_code problem;
  const char* const share = std::getenv("TENON_SHARE");  // set by `tenon`
  if (share == nullptr || path.has_parent_path() || std::filesystem::exists(path, problem)) return path;
  const std::filesystem::path shipped = std::filesystem::path(share) / "scenarios" / path;
  return std::filesystem::exists(shipped, problem) ? shipped : path;
}

}  // namespace

Result<ScenarioFile> readScenario(const std::filesystem::path& named, const ReadOptions& options) {
  std::error_code problem;
  const std::filesystem::path path = located(named);
  const std::filesystem::path file =
      std::filesystem::is_directory(path, problem) ? path / "scenario.yaml" : path;
  const std::uintmax_t size = std::filesystem::file_size(file, problem);
  if (problem)
    return fail(file.string() +
                ": no such scenario file, expected a folder with a scenario.yaml, a file, or a "
                "shipped scenario: engine_bay, peg_and_box, stacking");
  if (size > kLargestFile)
    return fail(file.string() + ": larger than 1 MB, expected a scenario of a few pages of YAML");
  std::ifstream stream(file, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (stream.bad() || text.size() != size) return fail(file.string() + ": cannot be read");
  return parseScenario(text, file, options);
}

Result<ScenarioFile> parseScenario(std::string_view text, const std::filesystem::path& path,
                                   const ReadOptions& options) {
  return ScenarioReader(path, options).read(text);
}

}  // namespace tenon::game_control
