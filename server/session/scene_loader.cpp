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

namespace tenon {
namespace {

namespace fs = std::filesystem;

/// A program that was built and installed beside this one.
fs::path siblingProgram(const std::string& name) {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).parent_path() / name;
}

Result<void> run(const std::vector<std::string>& words) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t silent;
  posix_spawn_file_actions_init(&silent);
  posix_spawn_file_actions_addopen(&silent, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int started = posix_spawn(&child, argv[0], &silent, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&silent);
  if (started != 0) return fail(fmt::format("cannot start {}: is the installation complete?", words[0]));
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return fail(fmt::format("{} did not finish its work", words[0]));
  return {};
}

/// Has the parts of a scenario made, unless they are there already.
Result<fs::path> generatedParts(const ScenarioFile& scenario, const LoadOptions& options) {
  const fs::path program = std::getenv("TENON_PARTS") != nullptr ? fs::path(std::getenv("TENON_PARTS"))
                                                                 : siblingProgram("tenon-parts");
  const fs::path folder = options.cache / "parts" / fmt::format("{}-{:.2f}", scenario.name, options.detail);
  std::error_code error;
  // made by another version of the generator: make them again
  const bool fresh = fs::exists(folder, error) &&
                     fs::last_write_time(folder, error) > fs::last_write_time(program, error) && !error;
  if (fresh) return folder;

  const fs::path making = folder.string() + fmt::format(".{}", getpid());
  fs::create_directories(making, error);
  if (error) return fail(fmt::format("{}: cannot make this folder ({})", making.string(), error.message()));
  const auto done =
      run({program.string(), scenario.name, making.string(), "--detail", fmt::format("{}", options.detail)});
  if (!done) return fail(done.error().what);
  fs::remove_all(folder, error);
  fs::rename(making, folder, error);
  if (error && !fs::exists(folder)) return fail(fmt::format("{}: {}", folder.string(), error.message()));
  return folder;
}

/// All meshes of an object as files of one unit.
Result<std::vector<fs::path>> meshFiles(const ScenarioFile& scenario, const ScenarioObject& object,
                                        const LoadOptions& options) {
  std::vector<fs::path> files;
  for (const MeshSource& mesh : object.meshes) {
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

Result<std::shared_ptr<const HapticStructures>> structuresOf(
    const ScenarioFile& scenario, ObjectId id, const LoadOptions& options, const LoadProgress& progress,
    const std::vector<std::shared_ptr<const HapticStructures>>& others) {
  const ScenarioObject& object = scenario.objects[id.value];
  const auto files = meshFiles(scenario, object, options);
  if (!files) return fail(files.error().what);
  BakeOptions bake;
  bake.voxel = object.structures.voxel;
  bake.refinement = object.structures.refinement;
  bake.points = object.structures.points;
  bake.point_spacing = object.structures.spacing;
  for (const Eigen::AlignedBox3d& box : refineBoxes(scenario, id, others)) bake.refine.push_back({box});
  const auto report = [&](double share, std::string_view doing) {
    if (progress) progress(fmt::format("{}: {}", object.title.front().text, doing), share);
    return true;
  };
  const auto file =
      bakeCached(*files, object.meshes.front().unit, bake, options.cache / "structures", report);
  if (!file)
    return fail(
        fmt::format("{}:{}: '{}': {}", scenario.path.string(), object.line, object.name, file.error().what));
  return openStructures(*file);
}

}  // namespace

Result<LoadedScene> loadScene(const fs::path& path, const LoadOptions& options,
                              const LoadProgress& progress) {
  auto file = readScenario(path);
  if (!file) return fail(file.error().what);
  const auto scenario = std::make_shared<const ScenarioFile>(std::move(*file));

  std::vector<std::shared_ptr<const HapticStructures>> structures(scenario->objects.size());
  for (const ObjectId id : bakeOrder(*scenario)) {
    if (!scenario->objects[id.value].felt) continue;
    auto baked = structuresOf(*scenario, id, options, progress, structures);
    if (!baked) return fail(baked.error().what);
    structures[id.value] = std::move(*baked);
  }
  auto scene = makeScene(*scenario, std::move(structures));
  if (!scene) return fail(scene.error().what);
  return LoadedScene{scenario, std::move(*scene)};
}

Fingerprint fingerprintOf(const LoadedScene& loaded) {
  Fingerprint made{fmt::format("{:016x}", loaded.scenario->text_hash), {}};
  for (const ObjectSpec& object : loaded.scene->objects)
    if (object.structures != nullptr) made.structures[object.name] = object.structures->info.content_hash;
  return made;
}

std::vector<std::string> changesSince(const Fingerprint& then, const LoadedScene& loaded) {
  const Fingerprint now = fingerprintOf(loaded);
  std::vector<std::string> changes;
  if (!then.scenario.empty() && then.scenario != now.scenario)
    changes.push_back(fmt::format("the text of {}", loaded.scenario->path.string()));
  for (const auto& [object, hash] : then.structures) {
    const auto found = now.structures.find(object);
    if (found == now.structures.end()) {
      changes.push_back(fmt::format("'{}' is not in it any more", object));
    } else if (found->second != hash) {
      changes.push_back(fmt::format("the structures of '{}'", object));
    }
  }
  if (!then.structures.empty())
    for (const auto& [object, hash] : now.structures)
      if (!then.structures.contains(object)) changes.push_back(fmt::format("'{}' is new in it", object));
  return changes;
}

fs::path defaultCache() {
  if (const char* cache = std::getenv("TENON_CACHE")) return cache;
  if (const char* cache = std::getenv("XDG_CACHE_HOME")) return fs::path(cache) / "tenon";
  if (const char* home = std::getenv("HOME")) return fs::path(home) / ".cache" / "tenon";
  return fs::temp_directory_path() / "tenon";
}

}  // namespace tenon
