#include "tests/bench/engine/measured_child.h"

#include <chrono>
#include <filesystem>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace tenon::bench {

namespace {

double secondsOf(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

Result<ProcessUsage> runMeasured(const std::string& program, const std::vector<std::string>& arguments) {
  std::error_code ignored;
  const std::string path =
      (std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path() / program).string();
  std::vector<char*> argv{const_cast<char*>(path.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t redirection;
  posix_spawn_file_actions_init(&redirection);
  posix_spawn_file_actions_addopen(&redirection, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const auto begin = std::chrono::steady_clock::now();
  const int started = posix_spawn(&child, path.c_str(), &redirection, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&redirection);
  if (started != 0) return fail(fmt::format("cannot start {}: is the installation complete?", path));
  int status = 0;
  rusage usage{};
  if (wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return fail(fmt::format("{} failed", program));
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  return ProcessUsage{wall.count(), secondsOf(usage.ru_utime) + secondsOf(usage.ru_stime),
                      1024.0 * static_cast<double>(usage.ru_maxrss)};
}

}  // namespace tenon::bench
