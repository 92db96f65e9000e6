#include "server/session/scene_loader.h"

#include <cstdlib>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/bake/bake.h"

extern char** environ;

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

/// A program in the folder of the running executable.
fs::path siblingProgram(const std::string& name) {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).parent_path() / name;
}

Result<void> run(const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t silent;
  posix_spawn_file_actions_init(&silent);
  posix_spawn_file_actions_addopen(&silent, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int started = posix_spawn(&child, argv[0], &silent, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&silent);
  if (started != 0) return fail(fmt::format("cannot start {}: is the installation complete?", arguments[0]));
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return fail(fmt::format("{} failed", arguments[0]));
  return {};
}

/// The folder of a scenario's generated parts; runs the generator unless the cache is up to date.
Result<fs::path> generatedParts(const game_control::ScenarioFile& scenario, const LoadOptions& options) {
  const fs::path program = std::getenv("TENON_PARTS") != nullptr ? fs::path(std::getenv("TENON_PARTS"))
                                                                 : siblingProgram("tenon-parts");
  const fs::path folder = options.cache / "parts" / fmt::format("{}-{:.2f}", scenario.name, options.detail);
  std::error_code error;
  // parts older than the generator are generated again
  const bool up_to_date = fs::exists(folder, error) &&
                          fs::last_write_time(folder, error) > fs::last_write_time(program, error) && !error;
  if (up_to_date) return folder;

  const fs::path temporary = folder.string() + fmt::format(".{}", getpid());
  fs::create_directories(temporary, error);
  if (error)
    return fail(fmt::format("{}: cannot make this folder ({})", temporary.string(), error.message()));
  const auto done = run(
      {program.string(), scenario.name, temporary.string(), "--detail", fmt::format("{}", options.detail)});
  if (!done) return fail(done.error().what);
  fs::remove_all(folder, error);
  fs::rename(temporary, folder, error);
  if (error && !fs::exists(folder)) return fail(fmt::format("{}: {}", folder.string(), error.message()));
  return folder;
}

/// The mesh files of an object; fails when their units differ.
Result<std::vector<fs::path>> meshFiles(const game_control::ScenarioFile& scenario,
                                        const game_control::ScenarioObject& object,
                                        const LoadOptions& options) {
  std::vector<fs::path> files;
  for (const game_control::MeshSource& mesh : object.meshes) {
    if (mesh.unit != object.meshes.front().unit)
      return fail(fmt::format("{}:{}: the meshes of '{}' have different units", scenario.path.string(),
                              object.line, object.name));
    if (mesh.part.empty()) {
      files.push_back(mesh.file);
      continue;
    }
    const auto folder = generatedParts(scenario, options);
    if (!folder) return fail(folder.error().what);
    files.push_back(*folder / (mesh.part + ".stl"));
  }
  return files;
}

Result<std::shared_ptr<const structures::HapticStructures>> structuresOf(
    const game_control::ScenarioFile& scenario, ObjectId id, const LoadOptions& options,
    const LoadProgress& progress,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& others) {
  const game_control::ScenarioObject& object = scenario.objects[id.value];
  const auto files = meshFiles(scenario, object, options);
  if (!files) return fail(files.error().what);
  bake::BakeOptions bake;
  bake.voxel = object.structures.voxel;
  bake.refinement = object.structures.refinement;
  bake.points = object.structures.points;
  bake.point_spacing = object.structures.spacing;
  for (const Eigen::AlignedBox3d& box : game_control::refineBoxes(scenario, id, others))
    bake.refine.push_back({box});
  const auto report = [&](double fraction, std::string_view activity) {
    if (progress) progress(fmt::format("{}: {}", object.title.front().text, activity), fraction);
    return true;
  };
  const auto file =
      bake::bakeCached(*files, object.meshes.front().unit, bake, options.cache / "structures", report);
  if (!file)
    return fail(
        fmt::format("{}:{}: '{}': {}", scenario.path.string(), object.line, object.name, file.error().what));
  return structures::openStructures(*file);
}

}  // namespace

Result<LoadedScene> loadScene(const fs::path& path, const LoadOptions& options,
                              const LoadProgress& progress) {
  auto file = game_control::readScenario(path);
  if (!file) return fail(file.error().what);
  const auto scenario = std::make_shared<const game_control::ScenarioFile>(std::move(*file));

  std::vector<std::shared_ptr<const structures::HapticStructures>> structures(scenario->objects.size());
  for (const ObjectId id : game_control::bakeOrder(*scenario)) {
    if (!scenario->objects[id.value].collidable) continue;
    auto baked = structuresOf(*scenario, id, options, progress, structures);
    if (!baked) return fail(baked.error().what);
    structures[id.value] = std::move(*baked);
  }
  auto scene = game_control::makeScene(*scenario, std::move(structures));
  if (!scene) return fail(scene.error().what);
  return LoadedScene{scenario, std::move(*scene)};
}

Fingerprint fingerprintOf(const LoadedScene& loaded) {
  Fingerprint fingerprint{fmt::format("{:016x}", loaded.scenario->text_hash), {}};
  for (const simulation::ObjectSpec& object : loaded.scene->objects)
    if (object.structures != nullptr)
      fingerprint.structures[object.name] = object.structures->info.content_hash;
  return fingerprint;
}

std::vector<std::string> changesSince(const Fingerprint& then, const LoadedScene& loaded) {
  const Fingerprint now = fingerprintOf(loaded);
  std::vector<std::string> changes;
  if (!then.scenario.empty() && then.scenario != now.scenario)
    changes.push_back(fmt::format("the text of {}", loaded.scenario->path.string()));
  for (const auto& [object, hash] : then.structures) {
    const auto found = now.structures.find(object);
    if (found == now.structures.end()) {
      changes.push_back(fmt::format("'{}' was removed", object));
    } else if (found->second != hash) {
      changes.push_back(fmt::format("the structures of '{}'", object));
    }
  }
  if (!then.structures.empty())
    for (const auto& [object, hash] : now.structures)
      if (!then.structures.contains(object)) changes.push_back(fmt::format("'{}' was added", object));
  return changes;
}

fs::path defaultCache() {
  if (const char* cache = std::getenv("TENON_CACHE")) return cache;
  if (const char* cache = std::getenv("XDG_CACHE_HOME")) return fs::path(cache) / "tenon";
  if (const char* home = std::getenv("HOME")) return fs::path(home) / ".cache" / "tenon";
  return fs::temp_directory_path() / "tenon";
}

}  // namespace tenon::session
