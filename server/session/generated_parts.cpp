#include "server/session/generated_parts.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

fs::path generator() {
  if (const char* given = std::getenv("TENON_PARTS")) return given;
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).parent_path() / "tenon-parts";
}

/// Reads until the other end is closed; false when `stop` was set before. [ms] `kPatience`.
bool readAll(int pipe_end, const std::atomic<bool>* stop, std::string& output) {
  constexpr int kPatience = 50;
  std::array<char, 4096> block{};
  while (stop == nullptr || !*stop) {
    pollfd waiting{pipe_end, POLLIN, 0};
    const int ready = poll(&waiting, 1, kPatience);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const ssize_t size = read(pipe_end, block.data(), block.size());
    if (size <= 0) return true;
    output.append(block.data(), static_cast<std::size_t>(size));
  }
  return false;
}

/// What a program prints to stdout; it is ended once `stop`, which may be null, is set.
Result<std::string> outputOf(const std::vector<std::string>& arguments, const std::atomic<bool>* stop) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::array<int, 2> pipe_ends{};
  if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) return fail("no pipe can be made: too many open files");
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
  pid_t child = 0;
  const int started = posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(pipe_ends[1]);
  std::string output;
  if (started == 0 && !readAll(pipe_ends[0], stop, output)) kill(child, SIGKILL);
  close(pipe_ends[0]);
  if (started != 0) return fail(fmt::format("cannot start {}: is the installation complete?", arguments[0]));
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return fail(fmt::format("{} failed", arguments[0]));
  return output;
}

std::vector<const game_control::MeshSource*> partMeshes(const game_control::ScenarioFile& scenario) {
  std::vector<const game_control::MeshSource*> meshes;
  for (const game_control::ScenarioObject& object : scenario.objects) {
    if (!object.collidable) continue;  // only displayed: no mesh is needed here
    for (const game_control::MeshSource& mesh : object.meshes)
      if (!mesh.part.empty()) meshes.push_back(&mesh);
  }
  return meshes;
}

bool has(const GeneratedSet& set, const std::string& part) {
  return std::find(set.parts.begin(), set.parts.end(), part) != set.parts.end();
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

}  // namespace

std::vector<GeneratedSet> parseSetList(const std::string& list) {
  std::vector<GeneratedSet> sets;
  std::istringstream lines(list);
  for (std::string line; std::getline(lines, line);) {
    std::string word;
    if (!(std::istringstream(line) >> word)) continue;
    if (line[0] != ' ') {
      sets.push_back({word, {}});
    } else if (!sets.empty()) {
      sets.back().parts.push_back(word);
    }
  }
  return sets;
}

Result<std::string> generatedSetOf(const game_control::ScenarioFile& scenario,
                                   const std::vector<GeneratedSet>& sets) {
  const auto meshes = partMeshes(scenario);
  if (meshes.empty()) return std::string{};
  const std::string file = scenario.path.string();
  std::vector<std::string> known;
  for (const GeneratedSet& set : sets) known.push_back(set.name);
  const auto missingIn = [&](const GeneratedSet& set) {
    return std::find_if(meshes.begin(), meshes.end(),
                        [&](const game_control::MeshSource* mesh) { return !has(set, mesh->part); });
  };

  if (!scenario.part_set.empty()) {
    const auto stated = std::find_if(sets.begin(), sets.end(),
                                     [&](const GeneratedSet& set) { return set.name == scenario.part_set; });
    if (stated == sets.end()) {
      return fail(fmt::format("{}:{}: 'parts' is '{}', expected a set of generated parts: {}", file,
                              scenario.part_set_line, scenario.part_set, joined(known)));
    }
    if (const auto missing = missingIn(*stated); missing != meshes.end()) {
      return fail(fmt::format("{}:{}: the parts of '{}' have no '{}', expected one of: {}", file,
                              (*missing)->line, stated->name, (*missing)->part, joined(stated->parts)));
    }
    return stated->name;
  }

  std::vector<std::string> candidates;
  for (const GeneratedSet& set : sets) {
    if (missingIn(set) != meshes.end()) continue;
    if (set.name == scenario.name) return set.name;
    candidates.push_back(set.name);
  }
  if (candidates.size() == 1) return candidates.front();
  if (candidates.size() > 1) {
    return fail(fmt::format(
        "{}:{}: several sets of generated parts have '{}' ({}), state one, as in 'parts: {}'", file,
        meshes.front()->line, meshes.front()->part, joined(candidates), candidates.front()));
  }
  for (const game_control::MeshSource* mesh : meshes) {
    if (std::none_of(sets.begin(), sets.end(),
                     [&](const GeneratedSet& set) { return has(set, mesh->part); })) {
      return fail(fmt::format("{}:{}: there is no generated part '{}'; 'tenon parts --list' lists all", file,
                              mesh->line, mesh->part));
    }
  }
  return fail(
      fmt::format("{}:{}: no set of generated parts has all parts of this scenario; 'tenon parts --list' "
                  "lists the sets ({})",
                  file, meshes.front()->line, joined(known)));
}

Result<fs::path> generatedParts(const game_control::ScenarioFile& scenario, const fs::path& cache,
                                double detail, const std::function<void()>& on_generation,
                                const std::atomic<bool>* stop) {
  if (partMeshes(scenario).empty()) return fs::path{};
  const fs::path program = generator();
  const auto list = outputOf({program.string(), "--list"}, stop);
  if (!list) return fail(list.error().what);
  const auto set = generatedSetOf(scenario, parseSetList(*list));
  if (!set) return fail(set.error().what);

  const fs::path folder = cache / "parts" / fmt::format("{}-{:.2f}", *set, detail);
  std::error_code error;
  // parts older than the generator are generated again
  const bool up_to_date = fs::exists(folder, error) &&
                          fs::last_write_time(folder, error) > fs::last_write_time(program, error) && !error;
  if (up_to_date) return folder;
  if (on_generation) on_generation();

  const fs::path temporary = folder.string() + fmt::format(".{}", getpid());
  fs::create_directories(temporary, error);
  if (error)
    return fail(fmt::format("{}: cannot make this folder ({})", temporary.string(), error.message()));
  const auto done = outputOf(
      {program.string(), *set, temporary.string(), "--detail", fmt::format("{}", detail), "--overwrite"},
      stop);
  if (!done) {
    fs::remove_all(temporary, error);
    return fail(done.error().what);
  }
  fs::remove_all(folder, error);
  fs::rename(temporary, folder, error);
  if (error && !fs::exists(folder)) return fail(fmt::format("{}: {}", folder.string(), error.message()));
  return folder;
}

}  // namespace tenon::session
